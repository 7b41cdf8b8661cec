"""Error of the points of a mesh from the rounding of coordinates in its file."""

import numpy as np
import trimesh

COORDINATE_SPACING = "coordinate_spacing"  # in the metadata of a mesh: (3,) [mm], of coordinates in its file; none if exact


def coordinate_spacing(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return the spacing (3,) [mm] of the coordinates that a mesh's file stores; zeros if it rounds none."""
    return np.asarray(mesh.metadata.get(COORDINATE_SPACING, np.zeros(3)))


def coordinate_error(mesh: trimesh.Trimesh) -> float:
    """Return the largest displacement [mm] of a point of a mesh caused by the rounding of coordinates in its file.

    The error of a vertex is e, with |e_i| at most half the spacing along axis i, so |e| is at most half the length of the
    spacing vector. A point of a triangle is a convex combination of its corners, and so is its error: within their triangles,
    planes have no larger errors than vertices. Two bodies that touch as drawn therefore penetrate each other, as stored, by no
    more than the sum of their errors, in any direction.
    """
    return float(np.linalg.norm(coordinate_spacing(mesh))) / 2
