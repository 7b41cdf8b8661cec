"""Weights of contact points: the areas that they stand for."""

import numpy as np
import trimesh
from scipy.spatial import KDTree

from tolcontact.arrays import Array, Float
from tolcontact.geometry.surface import Surface

ELEMENTS_PER_POINT = 16
MAX_ELEMENTS = 200_000
EDGE = 2.0137  # of the largest edge of an element, in its size: no edge of a model is just as long as that
NEIGHBOURS = 8  # at most, which share an element that is equally near to them
TIE = 1e-6  # of the size of an element


def point_weights(P_m: Float[Array, "point 3"], distance: float, moving: Surface, reference: Surface) -> Float[Array, " point"]:
    """Return weights (point,) in proportion to the area of the moving face that is nearest to each point; their mean is 1.

    Only that part of the face counts that lies over the reference face, no farther away than `distance` [mm]. The weights are
    adjusted, linearly along the face, so that the weighted centroid of the points is that of this part.
    """
    size = max(moving.mesh.area / min(ELEMENTS_PER_POINT * len(P_m), MAX_ELEMENTS), 0.0) ** 0.5
    vertices, faces = trimesh.remesh.subdivide_to_size(
        moving.mesh.vertices, moving.mesh.faces, max_edge=EDGE * size, max_iter=30
    )
    corners = np.asarray(vertices)[np.asarray(faces)]
    middles = corners.mean(axis=1)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    feet, _, is_over = reference.project(middles)
    counts = is_over & (np.linalg.norm(middles - feet, axis=1) <= distance + size)
    if not areas[counts].sum() > 0:
        return np.ones(len(P_m))
    middles, areas = middles[counts], areas[counts] / areas[counts].sum() * len(P_m)
    distances, nearest = KDTree(P_m).query(middles, k=np.arange(1, min(len(P_m), NEIGHBOURS) + 1))
    # What is equally near to several points is shared, so that rounding in another frame changes nothing.
    ties = distances <= distances[:, :1] + TIE * size
    shares = ties * (areas / ties.sum(axis=1))[:, None]
    weights = np.bincount(nearest.ravel(), weights=shares.ravel(), minlength=len(P_m))
    return _balanced(weights, P_m, areas @ middles / areas.sum())


def _balanced(weights: np.ndarray, points: np.ndarray, centroid: np.ndarray) -> np.ndarray:
    """Return weights (point,) with the same sum and a given centroid (3,); the same ones if some would be negative."""
    offsets = points - centroid
    first, second = weights @ offsets, (offsets * weights[:, None]).T @ offsets
    slope = np.linalg.lstsq(second - np.outer(first, first) / weights.sum(), first, rcond=1e-9)[0]
    factors = 1 - (offsets - first / weights.sum()) @ slope
    return weights * factors if (factors > 0).all() else weights
