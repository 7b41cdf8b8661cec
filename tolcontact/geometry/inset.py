"""Bodies from files that round coordinates, offset inward by that error, so that bodies that fit as drawn also fit as stored.

Rounding tilts the triangles of a plane relative to each other, by the coordinate error over their height, and lets bodies that
touch as drawn penetrate each other. Planes are made flat again, and all faces move into the material by the error.
"""

import numpy as np
import trimesh

from tolcontact.arrays import Array, Float, Int
from tolcontact.geometry.triangle_mesh import have_area
from tolcontact.geometry.vertex_displacements import TINY, capped, displacements

MIN_ANGLE, MAX_ANGLE = 1e-6, 0.05  # rad: triangles at a smaller angle may always be one plane, at a larger one never
MAX_ERRORS = 2.0  # coordinate errors: largest distance of a vertex from its fitted plane
MAX_DISPLACEMENT = 20.0  # coordinate errors: largest displacement of a vertex, where faces meet at sharp angles
MIN_CROSSING = 1e-3  # smallest singular value of the normals of planes that meet in a line or a corner
ROUNDED = 1e-9  # smaller components of normals are 0


def smaller(body: trimesh.Trimesh, error: float) -> trimesh.Trimesh:
    """Return a body with flat planes and all faces offset inward by an `error` [mm]; the body itself if that is 0."""
    if not error:
        return body
    whole = trimesh.Trimesh(body.vertices, np.asarray(body.faces)[have_area(body)], process=False)
    return trimesh.Trimesh(inset(whole, error), body.faces, process=False)


def inset(mesh: trimesh.Trimesh, error: float) -> Float[Array, "vertex 3"]:
    """Return the vertices [mm] of a mesh with flat planes and all faces offset inward by an `error` [mm].

    Triangles form one plane if the error of their vertices explains all angles between them; the plane is fitted to these
    vertices. Each vertex moves to the intersection of its planes. Where more than three meet, planes of several triangles come
    first, and the others are fitted as well as possible.
    """
    label = _coplanar(mesh, error)
    plane, vertices, normals, heights = _fitted(mesh, label)
    curved = np.unique(plane[np.abs(heights) > MAX_ERRORS * error])
    if curved.size:  # triangles that approximate a curved face, at small angles
        alone = np.flatnonzero(np.isin(label, curved))
        label[alone] = label.max() + 1 + np.arange(len(alone))
        label = np.unique(label, return_inverse=True)[1]
        plane, vertices, normals, heights = _fitted(mesh, label)
    is_joint, heights, count = (np.bincount(label) > 1)[plane], heights - error, len(mesh.vertices)
    joint = normals[is_joint]
    moved = displacements(vertices[is_joint], joint, np.column_stack([heights[is_joint], joint]), count, MIN_CROSSING)
    motions, free = moved[..., 0], np.eye(3) - moved[..., 1:]  # free: projection onto the directions left free by these planes
    vertex, lone = vertices[~is_joint], normals[~is_joint]
    remainder = heights[~is_joint] - (lone * motions[vertex]).sum(axis=1)
    lone = (lone[:, None] @ free[vertex])[:, 0]
    lone[np.abs(lone) < ROUNDED] = 0
    motions = motions + displacements(vertex, lone, remainder[:, None], count, MIN_CROSSING)[..., 0]
    return np.asarray(mesh.vertices) + capped(motions, MAX_DISPLACEMENT * error)


def _coplanar(mesh: trimesh.Trimesh, error: float) -> Int[Array, " face"]:
    """Return the plane of each triangle: neighbours share one if an error of their vertices explains their angle."""
    neighbours, ends = np.asarray(mesh.face_adjacency), np.asarray(mesh.face_adjacency_edges)
    lengths = np.linalg.norm(np.subtract(*np.asarray(mesh.vertices)[ends.T]), axis=1)
    heights = 2 * np.asarray(mesh.area_faces)[neighbours] / np.maximum(lengths, TINY)[:, None]
    tilts = 2 * error * (1 / np.maximum(heights, TINY)).sum(axis=1)  # a corner and an edge, each off by the error
    is_flat = np.asarray(mesh.face_adjacency_angles) <= tilts.clip(MIN_ANGLE, MAX_ANGLE)
    return np.asarray(trimesh.graph.connected_component_labels(neighbours[is_flat], node_count=len(mesh.faces)), dtype=np.int64)


def _fitted(mesh: trimesh.Trimesh, label: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the planes fitted to the vertices of the triangles of each label (face,), in pairs of a plane and a vertex of it.

    The results are the indices of both (pair,), the outward normals (pair, 3), and the heights (pair,) [mm] of the planes above
    the vertices.
    """
    number, vertex = np.unique(np.column_stack([label.repeat(3), np.asarray(mesh.faces).ravel()]), axis=0).T
    points, areas = np.asarray(mesh.vertices)[vertex], np.asarray(mesh.area_faces)[:, None] * np.asarray(mesh.face_normals)
    centres = _sums(number, points) / np.bincount(number)[:, None]
    arms = points - centres[number]
    moments = _sums(number, (arms[:, :, None] * arms[:, None]).reshape(-1, 9)).reshape(-1, 3, 3)
    normals = np.linalg.eigh(moments)[1][:, :, 0]
    normals *= np.where((normals * _sums(label, areas)).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    return number, vertex, normals[number], -(arms * normals[number]).sum(axis=1)


def _sums(group: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the sums (group, column) of values (row, column) of each group (row,)."""
    return np.column_stack([np.bincount(group, column) for column in values.T])
