"""Regions of a part's surface: how much of a face belongs to another one, however both were chosen. Part's own frame, mm."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import trimesh

from tolcontact.declaration import Face, Inside
from tolcontact.geometry.faces import CUT_MARGIN, Meshes, sliced, triangles


class Region(NamedTuple):
    """What a face covers: triangles (triangle,) of its part's mesh, as far as they lie in all boxes; its area [mm^2]."""

    triangles: np.ndarray
    boxes: tuple[Inside, ...]
    area: float


def region(face: Face, meshes: Meshes) -> Region:
    """The region of a face. Raises GeometryFault if it has no triangles."""
    boxes = tuple(each for each in face.selections if isinstance(each, Inside))
    chosen = triangles(face, meshes)
    return Region(chosen, boxes, _area(meshes[face.part], chosen, boxes))


def share(one: Region, other: Region, mesh: trimesh.Trimesh) -> float:
    """Which share of one region's area, on a part's mesh, belongs to another region, too."""
    common = np.intersect1d(one.triangles, other.triangles)
    if not common.size:
        return 0.0
    if len(common) == len(one.triangles) and not other.boxes:
        return 1.0
    return _area(mesh, common, (*one.boxes, *other.boxes)) / one.area


def _area(mesh: trimesh.Trimesh, chosen: np.ndarray, boxes: Sequence[Inside]) -> float:
    if not boxes:
        return float(np.asarray(mesh.area_faces)[chosen].sum())
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)[chosen]
    for box in boxes:
        if len(faces):
            vertices, faces = sliced(vertices, faces, box, CUT_MARGIN * mesh.scale)
    return float(trimesh.triangles.area(vertices[faces]).sum()) if len(faces) else 0.0
