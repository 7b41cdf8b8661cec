"""The B-rep faces of a body as its STEP file states them. Lengths in mm.

A face may stand in its shell a second time. Its triangles then repeat those of the first one, which counts for both. All other
faces have numbers, also those of which the kernel makes no triangles at some chord: numbers do not depend on it.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

Records = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class FaceMeasure:
    """The `area` of a face [mm2], a `point` (3,) on it [mm], and its outward `normal` (3,) there."""

    area: float
    point: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class StatedFace:
    """A B-rep face.

    place    among all faces of the shape, from 0
    name     "" for a face without a name
    records  numbers of its records in the file's text, its own first, then those of its copies; empty if it states no PMI
    copies   number of other faces that stand in the same place, and have no triangles of their own
    measure  None if the kernel finds none, as for a face that the file states by triangles
    """

    place: int
    name: str
    records: Records
    copies: int
    measure: FaceMeasure | None

    def placed(self, R: np.ndarray, t: np.ndarray) -> "StatedFace":
        """Return the face in a frame to which its own is turned by `R` (3, 3) and moved by `t` (3,) [mm]."""
        if self.measure is None:
            return self
        return replace(self, measure=FaceMeasure(self.measure.area, R @ self.measure.point + t, R @ self.measure.normal))


def stated_faces(
    arrays: Mapping[str, np.ndarray], shape: int, numbers_of_records: np.ndarray, first_of: np.ndarray
) -> tuple[StatedFace, ...]:
    """Return the faces of a `shape` without copies, in their order, from the `arrays` of `worker`.

    numbers_of_records  (record + 1,) numbers of all records in the file's text, after a 0
    first_of            (face,) for each face of the shape: itself, or the face of which it is a copy
    """
    names, places, measures = (json.loads(str(arrays[key][shape])) for key in ("face_names", "face_records", "measures"))
    faces = []
    for number in np.unique(first_of):
        members = sorted(np.flatnonzero(first_of == number), key=lambda member: member != number)
        records = [int(numbers_of_records[places[member]]) for member in members] if places else []
        measure = _measure(measures[number])
        faces.append(StatedFace(int(number), names[number], tuple(filter(None, records)), len(members) - 1, measure))
    return tuple(faces)


def _measure(entry: Sequence | None) -> FaceMeasure | None:
    return None if entry is None else FaceMeasure(entry[0], np.array(entry[1]), np.array(entry[2]))


def first_faces(brep: np.ndarray, repeated: np.ndarray, count: int) -> np.ndarray:
    """Return for each of `count` faces the face of which it is a copy, or itself.

    brep      (triangle,) the faces of the triangles that are kept
    repeated  (triangle, 2) the face of a triangle that is left out, and that of the kept triangle in the same place
    """
    first = np.arange(count)
    first[repeated[::-1, 0]] = repeated[::-1, 1]
    first[brep] = brep
    return first
