"""Features: faces of a part that have a name, and deviate as a whole."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tolcontact.declaration.feature_tolerance import GeometricTolerance, Size
from tolcontact.declaration.point import Point
from tolcontact.declaration.vectors import is_length, vector
from tolcontact.readable import Readable

if TYPE_CHECKING:
    from tolcontact.declaration.part import Face, Part

LETTER = re.compile(r"[A-Z]{1,2}")


@dataclass(frozen=True, eq=False, repr=False)
class Feature(Readable):
    """A face of a part, or two that are opposed (a slot, a tab, a thickness), with a name and its tolerances.

    It serves wherever a face or a point does. Whatever touches, holds or measures it goes with its one deviation, which is
    outward from the material. `datum` is the letter by which tolerances refer to it.
    """

    name: str
    part: "Part"
    faces: "tuple[Face, ...]"
    tolerances: tuple[Size | GeometricTolerance, ...]
    datum: str | None
    declared_at: str

    @property
    def size(self) -> Size | None:
        """The tolerance of its size, if it has one."""
        return next((each for each in self.tolerances if isinstance(each, Size)), None)

    @property
    def geometric(self) -> tuple[GeometricTolerance, ...]:
        """Its other tolerances."""
        return tuple(each for each in self.tolerances if isinstance(each, GeometricTolerance))

    def point(self, x: float, y: float, z: float) -> Point:
        """The point (x, y, z) [mm] of its part, which moves with the feature when it deviates."""
        return Point(self.part, vector((x, y, z)), self)

    def axis(self, end: int) -> Point:
        """An end of the axis of a cylinder or cone, 0 or 1, in the sense of its largest component; of a sphere the centre."""
        return Point(self.part, None, self, end)

    def faults(self) -> Iterator[str]:
        for face in self.faces:
            yield from face.faults()
            if face.part is not self.part:
                yield f'its face {face} belongs to part "{face.part.name}"'
        if not 1 <= len(self.faces) <= 2:
            yield f"it has {len(self.faces)} faces; expected one, or two that are opposed"
        if self.datum is not None and not (isinstance(self.datum, str) and LETTER.fullmatch(self.datum)):
            yield f"its datum letter is {self.datum!r}; expected one or two capital letters"
        for tolerance in self.tolerances:
            yield from (f"{tolerance.word}: {fault}" for fault in tolerance.faults())
        if sum(isinstance(each, Size) for each in self.tolerances) > 1:
            yield "its size is toleranced twice; leave one out"
        for each in self.geometric:
            if each.material and self.size is None:
                yield f"{each.word}: a bonus (material {each.material!r}) needs the tolerance of a size; add tc.Size(...)"
        if self.size and self.size.moves != "both" and len(self.faces) == 1:
            yield f"size: moves is {self.size.moves!r}, but the feature has one face; leave it out"
        elif self.size and self.size.moves != "both" and any(each.kind != "flatness" for each in self.geometric):
            yield (
                f"size: moves is {self.size.moves!r}, so the feature has no middle that could have a place; give its other "
                'tolerances to a feature of the face alone, in place of the size, or let "both" move'
            )
        yield from self._form_faults()

    def _form_faults(self) -> Iterator[str]:
        sound = [each for each in self.geometric if is_length(each.width)]
        for form in (each for each in sound if each.kind == "flatness"):
            for other in sound:
                if other.kind != "flatness" and other.width < form.width:
                    yield (
                        f"{form.word} {form.width:g} is wider than {other.word} {other.width:g}, which contains it; "
                        "expected form within orientation within location"
                    )

    def __str__(self) -> str:
        letter = f" (datum {self.datum})" if self.datum else ""
        said = "; ".join([", ".join(str(face) for face in self.faces), *map(str, self.tolerances)])
        return f"feature {self.name} of {self.part.name}{letter}: {said}"
