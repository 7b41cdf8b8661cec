"""The common base of features and patterns: tolerances, and whether these are compatible."""

import re
from collections.abc import Iterator
from typing import Any, ClassVar, Literal, get_args

from tolcontact.declaration.checks import Declaration
from tolcontact.declaration.feature_tolerance import GeometricTolerance, Position
from tolcontact.declaration.size import Size
from tolcontact.declaration.values import is_length

Control = Size | GeometricTolerance  # what limits a feature
Association = Literal["outside", "least squares"]  # from a plane to a datum, ISO 5459
ASSOCIATIONS = get_args(Association)
OUTSIDE = ASSOCIATIONS[0]
LETTER = re.compile(r"[A-Z]{1,2}")


class Toleranced(Declaration):
    """A feature or a pattern, with its tolerances.

    noun         its name in messages
    has_members  whether it has several members, whose zones may be combined
    """

    noun: ClassVar[str] = "feature"
    has_members: ClassVar[bool] = False

    part: Any
    tolerances: tuple[Control, ...]
    datum: str | None

    @property
    def label(self) -> str:
        """The label "part.feature", with which the labels of its freedoms begin."""
        return f"{self.part.name}.{self.name}"

    @property
    def size(self) -> Size | None:
        """The tolerance of the size; None without one."""
        return next((tolerance for tolerance in self.tolerances if isinstance(tolerance, Size)), None)

    @property
    def geometric(self) -> tuple[GeometricTolerance, ...]:
        """The geometric tolerances, without the size."""
        return tuple(tolerance for tolerance in self.tolerances if isinstance(tolerance, GeometricTolerance))

    def in_words(self, constituents: str) -> str:
        """Return its line in the text of an assembly, with its faces or members in words."""
        letter = f" (datum {self.datum})" if self.datum else ""
        return f"{self.noun} {self.name} of {self.part.name}{letter}: {'; '.join([constituents, *map(str, self.tolerances)])}"

    def tolerance_faults(self, faces: int) -> Iterator[str]:
        """Yield the faults of the tolerances, each and together, for a number of faces."""
        for tolerance in self.tolerances:
            yield from (f"{tolerance.kind}: {fault}" for fault in tolerance.faults())
        for tolerance in self.geometric:
            is_common = self.combines(tolerance) and tolerance.of is Position
            if tolerance.of.needs_datums and not tolerance.datums and not is_common:
                example = f'tc.{tolerance.of.name}({tolerance.width!r}, "A|B|C")'
                yield f"{tolerance.kind}: it needs datums; give them as in {example}"
            if tolerance.combined is not None and not self.has_members:
                yield f"{tolerance.kind}: combined zones are for patterns; leave combined out"
        yield from self._size_faults(faces)
        yield from self._form_faults()

    def combines(self, tolerance: GeometricTolerance) -> bool:
        """Return whether the zones of its members keep their places to each other."""
        return self.has_members and (self.part.standard != "ISO" if tolerance.combined is None else tolerance.combined)

    @property
    def is_enveloped(self) -> bool:
        """Whether its form stays inside the envelope of its size."""
        stated = self.size.envelope if self.size else False
        return bool(self.part.standard == "ASME" if stated is None else stated)

    def _size_faults(self, faces: int) -> Iterator[str]:
        if sum(isinstance(tolerance, Size) for tolerance in self.tolerances) > 1:
            yield "its size is toleranced twice; leave one out"
        for tolerance in self.geometric:
            if tolerance.material and self.size is None:
                yield (
                    f"{tolerance.kind}: a bonus (material {tolerance.material!r}) needs the tolerance of a size; "
                    "add tc.Size(...)"
                )
        if self.size and self.size.moves != "both" and faces == 1:
            yield f"size: moves is {self.size.moves!r}, but the feature has one face; leave it out"
        elif self.size and self.size.moves != "both" and any(not tolerance.is_form for tolerance in self.geometric):
            yield (
                f"size: moves is {self.size.moves!r}, so the feature has no middle that could have a place; give its other "
                'tolerances to a feature of the face alone, in place of the size, or let "both" move'
            )

    def _form_faults(self) -> Iterator[str]:
        tolerances = [tolerance for tolerance in self.geometric if is_length(tolerance.width)]
        for form in (tolerance for tolerance in tolerances if tolerance.is_form):
            for tolerance in tolerances:
                is_around = not tolerance.is_form and not tolerance.tangent  # a tangent plane has no form
                contains = is_around and (tolerance.of.limits_wall or not form.of.is_round)
                if contains and tolerance.width < form.width:
                    yield (
                        f"{form.kind} {form.width:g} is wider than {tolerance.kind} {tolerance.width:g}, which contains it; "
                        "expected form within orientation within location"
                    )


def letter_faults(datum: object) -> Iterator[str]:
    """Yield the fault of a datum letter; None is no letter."""
    if datum is not None and not (isinstance(datum, str) and LETTER.fullmatch(datum)):
        yield f"its datum letter is {datum!r}; expected one or two capital letters"
