"""Weights of contact points: the areas that they stand for, and the shares of springs that these areas have."""

from typing import NamedTuple

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
    elements = _elements(P_m, distance, moving, reference)
    if elements is None:
        return np.ones(len(P_m))
    return _balanced(_nearest_areas(P_m, elements), P_m, elements.areas @ elements.middles / elements.areas.sum())


def spring_shares(P_m: Float[Array, "point 3"], distance: float, moving: Surface, reference: Surface) -> Float[Array, " point"]:
    """Return the share (point,) of each point in a layer of springs under the same part of a flat moving face.

    Sum, centroid and second moments of the shares are those of the area, so that the layer has the stiffness of a continuous
    one, also against tilts, as long as all of it is compressed; unless that takes shares below 0.
    """
    elements = _elements(P_m, distance, moving, reference)
    if elements is None:
        return np.full(len(P_m), 1 / len(P_m))
    shares = _nearest_areas(P_m, elements) / len(P_m)
    # The middles of the edges of triangles integrate quadratic functions exactly.
    places = (elements.corners + np.roll(elements.corners, 1, axis=1)).reshape(-1, 3) / 2
    areas = np.repeat(elements.areas / 3, 3) / elements.areas.sum()
    centre = areas @ places
    along = np.linalg.svd((places - centre) * np.sqrt(areas)[:, None], full_matrices=False)[2][:2]
    of_points, of_area = (_quadratics((positions - centre) @ along.T) for positions in (P_m, places))
    moments = areas @ of_area - shares @ of_points
    scale = np.abs(of_area).max(axis=0)
    of_points, moments = of_points / scale, moments / scale
    factors = 1 + of_points @ np.linalg.lstsq((of_points * shares[:, None]).T @ of_points, moments, rcond=1e-9)[0]
    return shares * factors if (factors > 0).all() else shares


class _Elements(NamedTuple):
    """Small triangles of a face: corners (element, 3, 3), middles (element, 3), and areas (element,), whose sum is given."""

    corners: np.ndarray
    middles: np.ndarray
    areas: np.ndarray
    size: float


def _elements(P_m: np.ndarray, distance: float, moving: Surface, reference: Surface) -> _Elements | None:
    """Return the elements of the part of the moving face that counts, in areas of 1 for each point; None without any."""
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
        return None
    return _Elements(corners[counts], middles[counts], areas[counts] / areas[counts].sum() * len(P_m), size)


def _nearest_areas(P_m: np.ndarray, elements: _Elements) -> np.ndarray:
    """Return the area (point,) that is nearest to each point."""
    distances, nearest = KDTree(P_m).query(elements.middles, k=np.arange(1, min(len(P_m), NEIGHBOURS) + 1))
    # What is equally near to several points is shared, so that rounding in another frame changes nothing.
    ties = distances <= distances[:, :1] + TIE * elements.size
    shares = ties * (elements.areas / ties.sum(axis=1))[:, None]
    return np.bincount(nearest.ravel(), weights=shares.ravel(), minlength=len(P_m))


def _quadratics(x: np.ndarray) -> np.ndarray:
    """Return 1, the coordinates x (n, 2) [mm], and their products (n, 6)."""
    u, v = x.T
    return np.column_stack([np.ones(len(x)), u, v, u * u, u * v, v * v])


def _balanced(weights: np.ndarray, points: np.ndarray, centroid: np.ndarray) -> np.ndarray:
    """Return weights (point,) with the same sum and a given centroid (3,); the same ones if some would be negative."""
    offsets = points - centroid
    first, second = weights @ offsets, (offsets * weights[:, None]).T @ offsets
    slope = np.linalg.lstsq(second - np.outer(first, first) / weights.sum(), first, rcond=1e-9)[0]
    factors = 1 - (offsets - first / weights.sum()) @ slope
    return weights * factors if (factors > 0).all() else weights
