"""Criteria that select the triangles of a face. Coordinates [mm] are in the part's own frame."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from tolcontact.declaration.checks import LENGTH, TRUTH, Checked, one_of
from tolcontact.declaration.values import DIRECTIONS, Direction, Vector, direction as _direction, is_finite, is_length, vector
from tolcontact.readable import Readable
from tolcontact.texts import shown
from tolcontact.vocabulary import SURFACE_KINDS, SurfaceKind

Picker = Callable[[np.ndarray, np.ndarray], np.ndarray]
FACE_ANGLE = math.radians(1.0)
KINDS = (*SURFACE_KINDS, "general")  # of surfaces
FaceGroup = Literal["slot", "pattern"]  # one of their faces selects all of them
FACE_GROUPS = get_args(FaceGroup)


@dataclass(frozen=True, repr=False)
class Facing(Readable):
    """Triangles whose outward normal is within `angle` [rad] of `direction`: `tc.select.Facing((0, 1, 1), 0.1)`."""

    direction: Direction
    angle: float = FACE_ANGLE

    @property
    def axis(self) -> Vector:
        """Unit vector."""
        return _direction(self.direction)

    def faults(self) -> Iterator[str]:
        if not is_finite(self.axis):
            yield (
                f'unknown face "{self.direction}"; expected one of {", ".join(DIRECTIONS)}, a criterion such as '
                "tc.select.Inside(...), triangle indices, or a function of centres and normals"
            )
        if not (is_length(self.angle) and 0 < self.angle < math.pi):
            yield f"angle is {self.angle!r}; expected radians between 0 and pi"

    def __str__(self) -> str:
        if isinstance(self.direction, str):
            return self.direction
        return "facing ({:g}, {:g}, {:g})".format(*self.axis)


@dataclass(frozen=True, repr=False)
class Triangles(Readable):
    """Triangles by their indices in the mesh."""

    indices: tuple[int, ...]

    def faults(self) -> Iterator[str]:
        if not all(hasattr(index, "__index__") and not isinstance(index, bool) for index in self.indices):
            yield (
                "triangle indices must be whole numbers; for another direction use tc.select.Facing((x, y, z)), for a mask "
                "a function of centres and normals, or np.flatnonzero(mask)"
            )

    def __str__(self) -> str:
        return f"({len(self.indices)} triangles)"


@dataclass(frozen=True, eq=False, repr=False)
class Picked(Checked):
    """Triangles that a function `(centres, normals) -> mask` of arrays (triangle, 3) [mm, -] picks."""

    function: Picker

    def __str__(self) -> str:
        return "(selected)"


@dataclass(frozen=True, repr=False)
class Inside(Readable):
    """The surface inside the box from `lower` to `upper` [mm]; triangles that cross its sides are cut there.

    `part.face("+z", tc.select.Inside((0, 0, 9), (50, 50, 11)))`
    """

    lower: Vector
    upper: Vector

    def __init__(self, lower: Any, upper: Any) -> None:
        vars(self).update(lower=vector(lower), upper=vector(upper))

    def faults(self) -> Iterator[str]:
        if not (is_finite(self.lower) and is_finite(self.upper)):
            yield f"a box is from {self.lower!r} to {self.upper!r}; expected two corners of three finite numbers each"
        elif not all(low < up for low, up in zip(self.lower, self.upper, strict=True)):
            yield f"box from {self.lower} to {self.upper} is empty; its first corner must be the lower one in x, y and z"

    def __str__(self) -> str:
        return "inside ({:g}, {:g}, {:g}) to ({:g}, {:g}, {:g})".format(*self.lower, *self.upper)


@dataclass(frozen=True, eq=False, repr=False)
class Near(Checked):
    """Flat faces, and triangles of curved ones, that face `part` and come `within` [mm] of it: `tc.select.Near(pin, 0.2)`."""

    part: Any  # a Part, whose module imports this one
    within: float

    checks: ClassVar = {"within": LENGTH}

    def __str__(self) -> str:
        return f"within {self.within:g} mm of {self.part.name}"


@dataclass(frozen=True, repr=False)
class Brep(Readable):
    """Faces of the B-rep of a STEP file: `which` are numbers (`tolcontact faces` lists them), names, or points [mm].

    With `whole`, each one selects all faces that make up its surface: the two halves of a hole, or the parts of a bore that
    keyways interrupt. With `whole="slot"` it selects the two planes and the two round ends of its slot, and with
    `whole="pattern"` for all equal holes of the body with parallel axes.
    `Brep(3) | Brep("seat")` are the faces of both.
    """

    which: tuple[int | str | Vector, ...]
    whole: bool | FaceGroup

    def __init__(self, *which: Any, whole: bool | FaceGroup = False) -> None:
        vars(self).update(which=tuple(map(_brep_face, which)), whole=whole)

    def __or__(self, other: "Brep") -> "Brep":
        if not isinstance(other, Brep):
            return NotImplemented
        if self.whole != other.whole:
            raise TypeError(
                "a union of B-rep faces is of whole surfaces, or of single faces; state the same whole for both, or for none"
            )
        return Brep(*self.which, *other.which, whole=self.whole)

    def faults(self) -> Iterator[str]:
        if not self.which:
            yield "B-rep faces need numbers, names, or points"
        for face in self.which:
            if isinstance(face, tuple) and not is_finite(face):
                yield f"a B-rep face is {face!r}; expected its number, its name, or a point on it, three finite numbers"
        if "" in self.which:
            yield "a B-rep face has an empty name; give its number, or a point on it"
        if not (isinstance(self.whole, bool) or self.whole in FACE_GROUPS):
            yield f"whole is {self.whole!r}; expected True, False, {' or '.join(map(repr, FACE_GROUPS))}"

    def __str__(self) -> str:
        prefix = f"{self.whole} of " if isinstance(self.whole, str) else "whole " if self.whole else ""
        return prefix + " and ".join(map(_brep_words, self.which))


def _brep_face(which: Any) -> int | str | Vector:
    if isinstance(which, str):
        return which
    is_number = np.ndim(which) == 0 and hasattr(which, "__index__") and not isinstance(which, bool)
    return int(which) if is_number else vector(which)


def _brep_words(which: int | str | Vector) -> str:
    if isinstance(which, tuple):
        return "B-rep face at ({:g}, {:g}, {:g})".format(*which)
    return f"B-rep face {which if isinstance(which, int) else shown(repr(which))}"


@dataclass(frozen=True, repr=False)
class Cylinder(Checked):
    """Cylindrical faces: of one `radius` [mm] only, and of holes (`inner=True`) or pins (`inner=False`) only.

    `tc.select.Cylinder(4, inner=True)` chooses holes of radius 4 mm; by default all cylinders are chosen.
    """

    radius: float | None = None
    inner: bool | None = None

    checks: ClassVar = {"radius": LENGTH, "inner": TRUTH}

    def __str__(self) -> str:
        noun = {None: "cylinders", True: "inner cylinders", False: "outer cylinders"}[self.inner]
        return noun + (f" of radius {self.radius:g} mm" if self.radius is not None else "")


@dataclass(frozen=True, repr=False)
class Largest(Checked):
    """The largest face of one `kind`; with a `direction` ("+x" to "-z", or a vector), the largest one along it.

    `tc.select.Largest("plane", "-y")`
    The normal of a plane points along the direction; the axis of a cylinder, cone or torus is parallel to it in either sense.
    Faces are the B-rep faces of a STEP file, and the smooth pieces of other meshes.
    """

    kind: SurfaceKind | Literal["general"]
    direction: Direction | None = None

    checks: ClassVar = {"kind": one_of(KINDS)}

    @property
    def axis(self) -> Vector | None:
        """Unit vector."""
        return None if self.direction is None else _direction(self.direction)

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        if self.axis is not None and not is_finite(self.axis):
            yield f'unknown direction "{self.direction}"; expected one of {", ".join(DIRECTIONS)}, or a vector'

    def __str__(self) -> str:
        return f"largest {self.kind}" + ("" if self.direction is None else f" facing {self.direction}")


Selection = Facing | Triangles | Picked | Inside | Near | Brep | Cylinder | Largest  # a criterion of triangles


def criterion(choice: Any) -> Selection:
    """Return the criterion for a direction, indices of triangles, a function, or a criterion. Raises TypeError for others."""
    if isinstance(choice, str):
        return Facing(choice)
    if isinstance(choice, Selection):
        return choice
    if callable(choice):
        return Picked(choice)
    try:
        return Triangles(tuple(choice))
    except TypeError as error:
        raise TypeError(
            f'a face cannot be chosen by {choice!r}; expected a direction ("+x" to "-z"), a criterion such as '
            "tc.select.Facing(...), triangle indices, or a function of centres and normals"
        ) from error
