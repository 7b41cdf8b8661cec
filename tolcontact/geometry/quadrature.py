"""Quadrature points of a face, with the areas that they represent."""

import numpy as np
import trimesh

from tolcontact.geometry.subdivision import subdivided


def quadrature(mesh: trimesh.Trimesh, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (point, 3) [mm] of a face about `step` [mm] apart, and the areas (point,) [mm^2] that they represent."""
    vertices, faces, _ = subdivided(mesh.vertices, mesh.faces, 2 * step)
    points, numbers = np.unique(np.round(vertices, 9), axis=0, return_inverse=True)
    faces = numbers.reshape(-1)[faces]
    areas = trimesh.triangles.area(points[faces])
    return points, np.bincount(faces.ravel(), np.repeat(areas / 3, 3), minlength=len(points))
