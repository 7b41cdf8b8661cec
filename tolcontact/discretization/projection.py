"""Nearest points of a reference surface (paper, 2.2)."""

import numpy as np
import trimesh


def project(points: np.ndarray, reference: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Project `points` (point, 3) [mm] onto the surface.

    Returns the nearest points (point, 3) [mm], the outward unit normals there (point, 3), and a mask (point,) of the
    points that lie over the surface, that is do not overhang its rim.
    """
    nearest, _, triangle = trimesh.proximity.closest_point(reference, points)
    normals = np.asarray(reference.face_normals)[triangle]
    offset = points - nearest
    sideways = np.linalg.norm(offset - (offset * normals).sum(axis=1, keepdims=True) * normals, axis=1)
    overhangs = (sideways > 1e-6 * reference.scale) & _on_rim(nearest, triangle, reference)
    return np.asarray(nearest), normals, ~overhangs


def _on_rim(nearest: np.ndarray, triangle: np.ndarray, reference: trimesh.Trimesh) -> np.ndarray:
    """Whether each nearest point lies on an edge that only one triangle has."""
    edges = np.sort(reference.edges, axis=1).reshape(-1, 3, 2)
    _, first, counts = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True)
    is_rim = (counts[first.ravel()] == 1).reshape(-1, 3)
    # Edge j of a triangle runs from corner j to corner j+1, so it faces corner j+2: there that coordinate is zero.
    barycentric = trimesh.triangles.points_to_barycentric(reference.triangles[triangle], nearest)
    on_edge = np.abs(barycentric[:, [2, 0, 1]]) < 1e-9
    return np.asarray((on_edge & is_rim[triangle]).any(axis=1))
