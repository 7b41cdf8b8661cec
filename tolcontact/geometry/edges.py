"""Edges of triangle meshes."""

import numpy as np
import trimesh

CREASE = np.cos(np.radians(30.0))  # facets that meet at a wider angle are two faces; else they approximate one curved face


def edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the three edges of each of `faces` (face, 3), one face after the other.

    The result is their ends (3 face, 2) in the sense of their triangle, the index of each edge (3 face,), and the number of
    triangles at each edge (edge,): one on the rim, two inside.
    """
    ends = np.asarray(faces, dtype=np.int64)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    key = ends.min(axis=1) * (int(ends.max(initial=0)) + 1) + ends.max(axis=1)
    _, edge, triangles = np.unique(key, return_inverse=True, return_counts=True)
    return ends, edge, triangles


def on_rim(faces: np.ndarray) -> np.ndarray:
    """Return a mask (face, 3) of the edges of `faces` (face, 3) that belong to one triangle only."""
    _, edge, triangles = edges(faces)
    return (triangles[edge] == 1).reshape(-1, 3)


def rim(faces: np.ndarray) -> np.ndarray:
    """Return the ends (edge, 2) of the edges of the rim."""
    ends, edge, triangles = edges(faces)
    return ends[triangles[edge] == 1]


def distinct_triangles(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices (distinct,) of the distinct triangles in `faces` (face, 3), and the position of each face among them.

    Triangles are the same if they have the same corners in the same sense.
    """
    lowest = np.argmin(faces, axis=1)
    turned = np.take_along_axis(faces, (lowest[:, None] + np.arange(3)) % 3, axis=1)
    return trimesh.grouping.unique_rows(turned)


def smooth_pieces(mesh: trimesh.Trimesh, indices: np.ndarray) -> np.ndarray:
    """Return the smooth piece of each triangle in `indices` (face,), from 0: no two neighbours in a piece meet in a crease."""
    position = np.full(len(mesh.faces), -1)
    position[indices] = np.arange(len(indices))
    pairs = position[np.asarray(mesh.face_adjacency)].reshape(-1, 2)
    smooth = (pairs >= 0).all(axis=1) & (np.cos(np.asarray(mesh.face_adjacency_angles)) > CREASE)
    return np.asarray(trimesh.graph.connected_component_labels(pairs[smooth], node_count=len(indices)))
