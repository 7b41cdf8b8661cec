"""The bodies of a STEP file: their triangles and their places. A part is one body. Lengths in mm."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tolcontact.errors import clipped
from tolcontact.geometry.files.stated_face import StatedFace

MAX_LISTED = 12  # bodies that a message lists


@dataclass(frozen=True, eq=False)
class Body:
    """A body in its place.

    name          a name that no other body of the file has; "" if the file states none
    path          names of the products that contain the body, from the root on
    place         (4, 4): from its own frame to the frame of the file [mm]
    triangles     (face,) its triangles among those of the file
    lower, upper  (3,) corners of the box around the body in its place
    is_open       whether its triangles do not close
    faces         its B-rep faces, in the file's order
    face_count    number of B-rep faces that the file states for a solid; 0 if it is no solid
    """

    name: str
    path: tuple[str, ...]
    place: np.ndarray
    triangles: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    is_open: bool
    faces: tuple[StatedFace, ...]
    face_count: int

    def __str__(self) -> str:
        title = ("open, " if self.is_open else "") + (f'"{clipped(self.name, 60)}"' if self.name else "without a name")
        size = " x ".join(f"{length:.4g}" for length in self.upper - self.lower)
        return f"{title}, {size} mm at ({', '.join(f'{x:.4g}' for x in (self.lower + self.upper) / 2)})"


@dataclass(frozen=True, eq=False)
class StepShape:
    """The shape of a body in the frame of its product.

    triangles     (face,) its triangles among those of the file
    is_open       whether the triangles do not close
    faces         its B-rep faces, in the file's order
    face_count    number of B-rep faces that the file states for a solid; 0 if it is no solid
    """

    triangles: np.ndarray
    is_open: bool
    faces: tuple[StatedFace, ...]
    face_count: int


@dataclass(frozen=True)
class ShapePlace:
    """A `shape` at a `place` (4, 4) [mm] within a `box` (2, 3); `path` are names of its products, `name` is the body's."""

    shape: int
    place: np.ndarray
    box: np.ndarray
    path: tuple[str, ...]
    name: str


def bodies(shapes: Sequence[StepShape], places: Sequence[ShapePlace]) -> list[Body]:
    """Return the bodies of a file in its order."""
    return list(_uniquely_named([_body(shapes[place.shape], place, is_alone=len(places) == 1) for place in places]))


def _uniquely_named(bodies: Sequence[Body]) -> Iterator[Body]:
    """Yield the bodies with different names: repeated names are numbered in the file's order."""
    names = {body.name for body in bodies}
    used: set[str] = set()
    for body in bodies:
        name, number = body.name, 1
        while name and (name in used or (number > 1 and name in names)):
            number += 1
            name = f"{body.name} ({number})"
        used.add(name)
        yield replace(body, name=name)


def listed(bodies: Sequence[Body]) -> str:
    """Return a list of bodies for a message: numbers, names, sizes and places."""
    entries = "; ".join(f"{number}. {body}" for number, body in enumerate(bodies[:MAX_LISTED], start=1))
    return entries + (f"; and {len(bodies) - MAX_LISTED} more (see tolcontact bodies)" if len(bodies) > MAX_LISTED else "")


def _body(shape: StepShape, place: ShapePlace, *, is_alone: bool) -> Body:
    """Return the body of a shape at a place. A solid that is alone in its file is no sheet, though faces may be missing."""
    is_open = shape.is_open and not (is_alone and shape.face_count)
    lower, upper = place.box
    return Body(
        place.name, place.path, place.place, shape.triangles, lower, upper, is_open, shape.faces, shape.face_count
    )  # fmt: skip
