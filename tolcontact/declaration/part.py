"""Parts, and the faces that other declarations pick from them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tolcontact.declaration.feature import Feature
from tolcontact.declaration.feature_tolerance import GeometricTolerance, Size
from tolcontact.declaration.geometry import Box, Mesh
from tolcontact.declaration.point import Point
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
    _features: list[Feature] = field(default_factory=list, init=False)

    @property
    def features(self) -> tuple[Feature, ...]:
        return tuple(self._features)

    def feature(self, name: str, *said: "Face | Size | GeometricTolerance", datum: str | None = None) -> Feature:
        """Name a face, or two that are opposed, with its tolerances: `part.feature("H1", face, tc.Size(...), datum="B")`."""
        for each in said:
            if not isinstance(each, Face | Size | GeometricTolerance):
                raise TypeError(
                    f'feature "{name}": {type(each).__name__} is neither a face nor a tolerance; expected part.face(...), '
                    "tc.Size(...), tc.Position(...) or another tolerance of a feature"
                )
        faces = tuple(each for each in said if isinstance(each, Face))
        tolerances = tuple(each for each in said if not isinstance(each, Face))
        self.add(Feature(name, self, faces, tolerances, datum, script_line()))
        return self._features[-1]

    def add(self, *features: Feature) -> None:
        """Features of this part that have been declared already."""
        self._features.extend(features)

    def point(self, x: float, y: float, z: float) -> Point:
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


def face_of(said: Face | Feature) -> Face:
    """The face that is meant by itself, or by a feature. Raises TypeError for a feature that has two of them."""
    if isinstance(said, Feature):
        if len(said.faces) != 1:
            raise TypeError(f'feature "{said.name}" has {len(said.faces)} faces; choose one of them: .faces[0]')
        return said.faces[0]
    return said
