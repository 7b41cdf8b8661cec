"""Error of the points of a mesh that is due to how its file stores coordinates."""

import numpy as np
import trimesh

COORDINATE_SPACING = "coordinate_spacing"  # in the metadata of a mesh: (3,) [mm], of coordinates in its file; none if exact


def coordinate_spacing(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return the spacing (3,) [mm] of the coordinates that a mesh's file stores; zeros if it rounds none."""
    return np.asarray(mesh.metadata.get(COORDINATE_SPACING, np.zeros(3)))


def coordinate_error(mesh: trimesh.Trimesh) -> float:
    """Return how far [mm] a point of a mesh may lie from where it was before its file rounded coordinates.

    A vertex is off by e, with |e_i| at most half the spacing along axis i, thus by half the length of the spacings at most. A
    point of a triangle is a mean of its corners with shares from 0 to 1, and so is its error: planes are off by no more within
    their triangles than vertices are. Two bodies that touch as drawn therefore lie in each other, as stored, no deeper than
    the sum of their two errors, in any direction.
    """
    return float(np.linalg.norm(coordinate_spacing(mesh))) / 2
