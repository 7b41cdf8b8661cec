"""Parts, and the points and faces that other declarations pick from them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tolcontact.declaration.geometry import Box, Mesh
from tolcontact.declaration.selection import Near, Selection, criterion
from tolcontact.declaration.vectors import Vector, is_finite, script_line, vector
from tolcontact.readable import Readable

if TYPE_CHECKING:
    from tolcontact.declaration.selection import Picker


@dataclass(frozen=True, eq=False, repr=False)
class Part(Readable):
    """A rigid body: its shape, its place in the nominal assembly, and whether contact may move it.

    Its own coordinates `p` lie at `rotation * p + at` in the nominal assembly frame; `rotation` is a rotation
    vector [rad], `at` a position [mm]. `fixed=None` leaves the choice to the model: a part that is the moving side of
    a contact pair, or that has one-sided locators, is free; any other is fixed.
    """

    name: str
    geometry: Box | Mesh
    at: Vector = (0.0, 0.0, 0.0)
    rotation: Vector = (0.0, 0.0, 0.0)
    fixed: bool | None = None
    declared_at: str = field(default_factory=script_line)

    def point(self, x: float, y: float, z: float) -> "Point":
        """The point (x, y, z) [mm] of this part, in its own frame."""
        return Point(self, vector((x, y, z)))

    def face(self, *selections: "str | Sequence[int] | Picker | Selection") -> "Face":
        """The triangles of this part that meet every criterion; without any, the whole surface.

        A criterion is a direction ("+x" to "-z": all triangles whose outward normal points there in the part's own
        frame), `tc.Facing`, `tc.Inside` a box, `tc.Near` another part, `tc.Cylinder`, `tc.Largest`, `tc.Brep` (a face of a
        STEP file), the indices of triangles, or a function `(centres, normals) -> mask` of arrays (triangle, 3) [mm, -].
        """
        return Face(self, tuple(map(criterion, selections)))

    def faults(self) -> Iterator[str]:
        yield from self.geometry.faults()
        for word, value in (("at", self.at), ("rotation", self.rotation)):
            if not is_finite(value):
                yield f"{word} is not a vector of three finite numbers"

    def __str__(self) -> str:
        place = "" if self.at == (0.0, 0.0, 0.0) else " at ({:g}, {:g}, {:g})".format(*self.at)
        choice = {None: "", True: ", fixed", False: ", free"}[self.fixed]
        return f"part {self.name}: {self.geometry}{place}{choice}"


@dataclass(frozen=True, eq=False, repr=False)
class Point(Readable):
    """A point of a part, in the part's own frame [mm]."""

    part: Part
    position: Vector

    def faults(self) -> Iterator[str]:
        if not is_finite(self.position):
            yield f'point of part "{self.part.name}" is not three finite numbers'

    def __str__(self) -> str:
        return "{} ({:g}, {:g}, {:g})".format(self.part.name, *self.position)


@dataclass(frozen=True, eq=False, repr=False)
class Face(Readable):
    """The triangles of a part's surface that meet every criterion."""

    part: Part
    selections: tuple[Selection, ...]

    @property
    def parts(self) -> tuple[Part, ...]:
        """The part itself, and those that its criteria refer to."""
        return (self.part, *(selection.part for selection in self.selections if isinstance(selection, Near)))

    def faults(self) -> Iterator[str]:
        for selection in self.selections:
            yield from (f'face of part "{self.part.name}": {fault}' for fault in selection.faults())

    def __str__(self) -> str:
        return " ".join([self.part.name, *map(str, self.selections)])
