"""Parts, and the points and faces that other declarations pick from them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tolcontact.assembly.geometry import Box, Mesh
from tolcontact.assembly.words import DIRECTIONS, Vector, direction, is_finite, script_line, vector

if TYPE_CHECKING:
    import numpy as np

    FaceFilter = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Part:
    """A rigid body: its shape, its place in the nominal assembly, and whether contact may move it.

    Its own coordinates `p` lie at `rotation * p + at` in the nominal assembly frame; `rotation` is a rotation
    vector [rad], `at` a position [mm]. `fixed=None` leaves the choice to the model: a part that is the moving side of
    a contact pair is free, any other is fixed.
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

    def face(self, selection: "str | Sequence[int] | FaceFilter") -> "Face":
        """A surface of this part.

        `selection` is a direction ("+x" to "-z": all triangles whose outward normal points there in the part's own
        frame), the indices of triangles, or a function `(centres, normals) -> mask` of arrays (triangle, 3) [mm, -].
        """
        return Face(self, selection if isinstance(selection, str) or callable(selection) else tuple(selection))

    def faults(self) -> Iterator[str]:
        yield from self.geometry.faults()
        for word, value in (("at", self.at), ("rotation", self.rotation)):
            if not is_finite(value):
                yield f"{word} is not a vector of three finite numbers"

    def __str__(self) -> str:
        place = "" if self.at == (0.0, 0.0, 0.0) else " at ({:g}, {:g}, {:g})".format(*self.at)
        choice = {None: "", True: ", fixed", False: ", free"}[self.fixed]
        return f"part {self.name}: {self.geometry}{place}{choice}"


@dataclass(frozen=True, eq=False)
class Point:
    """A point of a part, in the part's own frame [mm]."""

    part: Part
    position: Vector

    def faults(self) -> Iterator[str]:
        if not is_finite(self.position):
            yield f'point of part "{self.part.name}" is not three finite numbers'

    def __str__(self) -> str:
        return "{} ({:g}, {:g}, {:g})".format(self.part.name, *self.position)


@dataclass(frozen=True, eq=False)
class Face:
    """A surface of a part: a direction, triangle indices, or a function that picks triangles."""

    part: Part
    selection: Any

    def faults(self) -> Iterator[str]:
        if isinstance(self.selection, str) and not is_finite(direction(self.selection)):
            yield (
                f'unknown face "{self.selection}" of part "{self.part.name}"; '
                f"expected one of {', '.join(DIRECTIONS)}, triangle indices, or a function of centres and normals"
            )
        if isinstance(self.selection, tuple) and not all(
            isinstance(index, int) or hasattr(index, "__index__") for index in self.selection
        ):
            yield f'face of part "{self.part.name}": triangle indices must be whole numbers'

    def __str__(self) -> str:
        if isinstance(self.selection, str):
            return f"{self.part.name} {self.selection}"
        if isinstance(self.selection, tuple):
            return f"{self.part.name} ({len(self.selection)} triangles)"
        return f"{self.part.name} (selected)"
