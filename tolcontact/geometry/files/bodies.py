"""The bodies of a STEP file: their shapes, their B-rep faces and their places. A part is one body. Lengths in mm.

A face may occur in its shell a second time. Its triangles then repeat the triangles of the first one, which counts for both.
All other faces have numbers, even if the kernel makes no triangles of them at some chord: numbers do not depend on the chord.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tolcontact.errors import clipped
from tolcontact.geometry.analytic_surfaces import AnalyticSurface

MAX_LISTED = 12  # bodies that a message lists


class FaceMeasure(NamedTuple):
    """The `area` of a face [mm2], a `point` (3,) on it [mm], and its outward `normal` (3,) there."""

    area: float
    point: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class StatedFace:
    """A B-rep face as a file states it.

    surface  None for an unknown one
    name     "" for a face without a name
    records  numbers of its records in the file's text, its own first, then the records of its copies; empty if it states no PMI
    copies   number of other faces in the same place, and have no triangles of their own
    measure  None if the kernel finds none, as for a face that the file states by triangles, and for faces from an archive
    """

    surface: AnalyticSurface | None = None
    name: str = ""
    records: tuple[int, ...] = ()
    copies: int = 0
    measure: FaceMeasure | None = None

    def placed(self, R: np.ndarray, t: np.ndarray) -> "StatedFace":
        """Return the face rotated by R (3, 3), then translated by t (3,) [mm]."""
        surface = self.surface and self.surface.placed(R, t)
        measure = self.measure and FaceMeasure(self.measure.area, R @ self.measure.point + t, R @ self.measure.normal)
        return replace(self, surface=surface, measure=measure)


@dataclass(frozen=True, eq=False)
class StepShape:
    """The shape of a body, or of several equal ones, in the frame of its product.

    vertices     (vertex, 3) [mm]
    triangles    (triangle, 3)
    brep         (triangle,) the B-rep face of each triangle, from 0
    faces        the B-rep faces, in the file's order
    face_count   number of B-rep faces that the file states for a solid; 0 if it is no solid
    gap_count    number of edges that have a triangle on one side only
    """

    vertices: np.ndarray
    triangles: np.ndarray
    brep: np.ndarray
    faces: tuple[StatedFace, ...]
    face_count: int
    gap_count: int


@dataclass(frozen=True, eq=False)
class Body:
    """A body in its place.

    name          a name that no other body of the file has; "" if the file states none
    path          names of the products that contain the body, from the root on
    place         (4, 4): from its own frame to the frame of the file [mm]
    box           (2, 3) lower and upper corner of the box around the body in its place
    is_open       whether its triangles do not close
    """

    name: str
    path: tuple[str, ...]
    place: np.ndarray
    box: np.ndarray
    is_open: bool
    shape: StepShape

    def __str__(self) -> str:
        title = ("open, " if self.is_open else "") + (f'"{clipped(self.name, 60)}"' if self.name else "without a name")
        size = " x ".join(f"{length:.4g}" for length in self.box[1] - self.box[0])
        return f"{title}, {size} mm at ({', '.join(f'{x:.4g}' for x in self.box.sum(axis=0) / 2)})"


def uniquely_named(bodies: Sequence[Body]) -> Iterator[Body]:
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
