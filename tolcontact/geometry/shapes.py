"""Conversion of a geometry to triangles with outward normals, in the part's own frame. Lengths in mm."""

import logging

import igl
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from tolcontact.declaration import Box, Geometry, Mesh, Part, Pin
from tolcontact.errors import GeometryFault
from tolcontact.geometry.files.reading import Contents, Shape, read, read_files
from tolcontact.geometry.triangle_mesh import distinct_triangles, edges, subdivided

log = logging.getLogger(__name__)

SECTIONS = 72  # triangles around a pin
HEAD_WIDTH, HEAD_HEIGHT = 1.6, 0.65  # of a pin, times its diameter, as for hexagon head bolts to ISO 4014
FIELD_DIVISIONS = 12  # number of edges across a part for showing its displacement field


def shape(geometry: Geometry, contents: Contents | None = None) -> Shape:
    """Return the closed or open triangle surface of a geometry. `contents` are the contents of files read in one pass.

    Raises GeometryFault if a mesh cannot be read, is empty, or its outside is undefined.
    """
    if isinstance(geometry, Box):
        return trimesh.creation.box(bounds=[[0, 0, 0], [geometry.x, geometry.y, geometry.z]])
    if isinstance(geometry, Pin):
        return _pin(geometry)
    mesh = read(geometry, read_files([geometry]) if contents is None else contents)
    if len(mesh.faces) == 0:
        raise GeometryFault(f"{geometry} has no triangles; expected a triangle surface")
    if not mesh.area > 0:
        raise GeometryFault(f"{geometry} has no area: all its triangles are degenerate")
    _leave_out_repetitions(mesh, geometry)
    _check_outward(mesh, geometry)
    return mesh


def _pin(pin: Pin) -> trimesh.Trimesh:
    """Return the closed surface of a pin; a head is round."""
    radius, profile = pin.diameter / 2, [(0.0, -pin.length), (pin.diameter / 2, -pin.length), (pin.diameter / 2, 0.0)]
    if pin.head:
        top = HEAD_HEIGHT * pin.diameter
        profile += [(HEAD_WIDTH * radius, 0.0), (HEAD_WIDTH * radius, top), (0.0, top)]
    else:
        profile += [(0.0, 0.0)]
    return trimesh.creation.revolve(profile, sections=SECTIONS)


def _leave_out_repetitions(mesh: trimesh.Trimesh, geometry: Mesh) -> None:
    """Remove repeated triangles of a mesh: a body that its file contains twice is one body."""
    _, position = trimesh.grouping.unique_rows(mesh.vertices)
    distinct, _ = distinct_triangles(position[mesh.faces])
    if len(distinct) < len(mesh.faces):
        log.info("%s: %d repeated triangles are left out", geometry, len(mesh.faces) - len(distinct))
        mesh.update_faces(np.sort(distinct))
        mesh.remove_unreferenced_vertices()


def _check_outward(mesh: trimesh.Trimesh, geometry: Mesh) -> None:
    """Raise GeometryFault if neighbours are oriented inconsistently, or closed bodies are turned inside out."""
    ends, edge, triangles = edges(mesh.faces)
    sense = np.where(ends[:, 0] < ends[:, 1], 1.0, -1.0)  # neighbours run along their common edge in opposite senses
    conflicts = int(np.count_nonzero((triangles == 2) & (np.abs(np.bincount(edge, sense)) == 2)))
    if conflicts:
        raise GeometryFault(
            f"{geometry}: neighbouring triangles are oriented inconsistently at {conflicts} edges, so its normals do not all "
            "point outward; repair it (trimesh.repair.fix_normals), or export it again"
        )
    neighbours = np.asarray(mesh.face_adjacency)
    body = trimesh.graph.connected_component_labels(neighbours, node_count=len(mesh.faces))
    count = int(body.max()) + 1
    is_open = np.zeros(count, dtype=bool)
    is_open[body[~_is_matched(body, edge, sense)]] = True
    corners = np.asarray(mesh.triangles) - mesh.vertices.mean(axis=0)
    volume = np.bincount(body, np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6, count)
    # A body with inward normals is a cavity if another body encloses it, otherwise an error.
    lower, upper = np.full((2, count, 3), np.array([np.inf, -np.inf])[:, None, None])
    np.minimum.at(lower, body, corners.min(axis=1))
    np.maximum.at(upper, body, corners.max(axis=1))
    for k in np.flatnonzero(~is_open & (volume < -1e-12 * mesh.scale**3)):
        outer = np.flatnonzero((volume > 0) & (lower <= lower[k]).all(axis=1) & (upper >= upper[k]).all(axis=1))
        if not any(_encloses(mesh, body == candidate, mesh.triangles[body == k][0, :1]) for candidate in outer):
            subject = "it is" if count == 1 else f"its body {k + 1} of {count} is"
            raise GeometryFault(
                f"{geometry}: {subject} inside out (volume {volume[k]:.6g} mm3), so its normals point inward; "
                "turn it (trimesh's invert()), or export it again"
            )


def _is_matched(body: np.ndarray, edge: np.ndarray, sense: np.ndarray) -> np.ndarray:
    """Return a mask (face,) of the triangles whose edges (3 face,) occur equally often in both senses in their body.

    Where bodies touch along an edge, more than two triangles share it, and the triangles of one body may not close there.
    """
    _, pair = np.unique(np.repeat(body, 3) * (int(edge.max()) + 1) + edge, return_inverse=True)
    return (np.bincount(pair, sense)[pair] == 0).reshape(-1, 3).all(axis=1)


def _encloses(mesh: trimesh.Trimesh, faces: np.ndarray, point: np.ndarray) -> bool:
    """Return whether the body of the `faces` (face,) encloses `point` (1, 3)."""
    turns = igl.winding_number(np.array(mesh.vertices), np.array(mesh.faces[faces], dtype=np.int64), np.array(point))
    return bool(np.abs(turns).max() > 0.5)


def placement_of(part: Part) -> tuple[np.ndarray, np.ndarray]:
    """Return R (3, 3) and t (3,) [mm] of a part in the nominal assembly; the determinant of R is -1 for a mirror image."""
    return reflected(Rotation.from_rotvec(part.rotation).as_matrix(), part.mirror), np.array(part.at)


def reflected(R: np.ndarray, mirror: str) -> np.ndarray:
    """Return R (3, 3) for a frame whose axis `mirror`, "x", "y" or "z", is reversed before; for "" the same."""
    return R * [-1.0 if axis == mirror else 1.0 for axis in "xyz"] if mirror else R


def field_surface(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (vertex, 3) and faces (face, 3) fine enough to show the displacement field of a part."""
    step = mesh.scale / FIELD_DIVISIONS
    vertices, faces, _ = subdivided(mesh.vertices, mesh.faces, step)
    merged = trimesh.Trimesh(vertices, faces, process=True)
    return np.asarray(merged.vertices), np.asarray(merged.faces)
