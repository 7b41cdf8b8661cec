"""Edges of triangle meshes."""

import numpy as np
import trimesh

CREASE = np.cos(np.radians(30.0))  # facets that meet at a wider angle are two faces; else they approximate one curved face


def edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The three edges of each of `faces` (face, 3), one face after the other.

    Returns their ends (3 face, 2) in the sense of their triangle, which edge each is (3 face,), and how many triangles
    each edge belongs to (edge,): one on the rim, two inside.
    """
    ends = np.asarray(faces, dtype=np.int64)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    key = ends.min(axis=1) * (int(ends.max(initial=0)) + 1) + ends.max(axis=1)
    _, edge, triangles = np.unique(key, return_inverse=True, return_counts=True)
    return ends, edge, triangles


def on_rim(faces: np.ndarray) -> np.ndarray:
    """Which edges (face, 3) of `faces` (face, 3) belong to one triangle only."""
    _, edge, triangles = edges(faces)
    return np.asarray((triangles[edge] == 1).reshape(-1, 3))


def rim(faces: np.ndarray) -> np.ndarray:
    """Ends (edge, 2) of the edges of the rim."""
    ends, edge, triangles = edges(faces)
    return np.asarray(ends[triangles[edge] == 1])


def smooth_pieces(mesh: trimesh.Trimesh, chosen: np.ndarray) -> np.ndarray:
    """The piece of each chosen triangle (face,) of a mesh, from 0: inside of a piece no two neighbours meet in a crease."""
    place = np.full(len(mesh.faces), -1)
    place[chosen] = np.arange(len(chosen))
    pairs = place[np.asarray(mesh.face_adjacency)].reshape(-1, 2)
    smooth = (pairs >= 0).all(axis=1) & (np.cos(np.asarray(mesh.face_adjacency_angles)) > CREASE)
    return np.asarray(trimesh.graph.connected_component_labels(pairs[smooth], node_count=len(chosen)))
