"""The features and patterns of an assembly with their tolerances and faces, as the data of a page."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from tolcontact.declaration import Assembly, Face, Feature, Part, Pattern
from tolcontact.declaration.feature_tolerance import GeometricTolerance
from tolcontact.declaration.selection import Inside
from tolcontact.declaration.size import Size
from tolcontact.errors import GeometryFault
from tolcontact.geometry.faces import Meshes, triangles

Entry = dict[str, Any]


def feature_lists(assembly: Assembly, meshes: Meshes) -> list[Entry]:
    """Return the features and patterns of each part that has any. `meshes` contains the meshes of all drawn parts, in order.

    number    of the drawn part; None if it is not drawn
    members   the feature itself, or the features of a pattern. The faces of a member consist of `runs` of consecutive triangles
              of the mesh (first triangle, and one after the last), clipped by all `boxes` (lower and upper corner [mm])
    """
    numbers: Mapping[Part, int] = {part: number for number, part in enumerate(meshes)}
    return [
        {
            "part": str(part.name),
            "number": numbers.get(part),
            "features": [_entry(declared, meshes) for declared in part.toleranced],
        }
        for part in assembly.parts
        if part.toleranced
    ]


def _entry(declared: Feature | Pattern, meshes: Meshes) -> Entry:
    return {
        "noun": declared.noun,
        "name": str(declared.name),
        "datum": None if declared.datum is None else str(declared.datum),
        "tolerances": [_text(tolerance) for tolerance in declared.tolerances],
        "members": [
            {"name": str(member.name), "faces": list(_faces(member, declared.part, meshes))} for member in declared.members
        ],
    }


def _text(tolerance: Size | GeometricTolerance) -> str:
    """Return a tolerance as printed, or only its kind if a fault prevents printing."""
    return tolerance.kind if any(tolerance.faults()) else str(tolerance)


def _faces(member: Feature, part: Part, meshes: Meshes) -> Iterator[Entry]:
    """Yield the faces of a member that have triangles on its part."""
    for face in member.faces:
        if face.part is part and not any(face.faults()) and all(mentioned in meshes for mentioned in face.parts):
            try:
                indices = triangles(face, meshes)
            except GeometryFault:  # a fault of the model, which the page lists
                continue
            yield {"runs": _runs(indices), "boxes": _boxes(face)}


def _runs(indices: np.ndarray) -> list[int]:
    """Return the first index, and one after the last, of each run of consecutive `indices` (index,)."""
    ends = np.flatnonzero(np.diff(indices) != 1)
    first, last = indices[np.r_[0, ends + 1]], indices[np.r_[ends, len(indices) - 1]]
    return [int(index) for index in np.column_stack([first, last + 1]).ravel()]


def _boxes(face: Face) -> list[list[list[float]]]:
    boxes = [selection for selection in face.selections if isinstance(selection, Inside)]
    return [[[float(x) for x in corner] for corner in (box.lower, box.upper)] for box in boxes]
