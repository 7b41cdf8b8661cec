"""Weights of contact points: the areas that they represent, with the moments of the face."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from tolcontact.arrays import Array, Float
from tolcontact.geometry.common_region import common_region
from tolcontact.geometry.spreading import face_frame
from tolcontact.geometry.surface import Surface

ELEMENTS_PER_POINT = 16
MAX_ELEMENTS = 200_000
EDGE = 2.0137  # of the largest edge of an element, in its size: no edge of a model is just as long as that
NEIGHBOURS = 8  # at most, which share an element that is equally near to them
TIE = 1e-6  # of the size of an element
LEAST_FACTOR = 0.1  # smallest ratio of a weight to the area that the point represents
MOMENT_TOLERANCE = 1e-11  # of the moments of weights of mean 1, in the size of the face
MAX_STEPS = 60
CONDITIONS = (10, 4)  # moments of the orders 0 to 2, or of 0 and 1


def point_weights(P_m: Float[Array, "point 3"], distance: float, moving: Surface, reference: Surface) -> Float[Array, " point"]:
    """Return weights (point,) in proportion to the area of the moving face that is nearest to each point; their mean is 1.

    Only the part of the face over the reference face counts, up to a `distance` [mm]. Weights have the moments of this part:
    its area, its centre, and its second moments. They are as close as possible to the nearest areas a, by the sum of
    (w - a)^2 / a, and each is at least a tenth of its area. With few points this may be impossible: then they have area and
    centre, or the area alone.
    """
    nearest = _elements(P_m, distance, moving, reference)
    region = common_region(moving, reference) if moving.is_flat and reference.is_flat else None
    # Areas of triangles that are cut along the reference face would depend on its tessellation; their moments do not.
    elements = nearest if region is None else _elements(P_m, distance, moving, reference, region, is_fine=nearest is None)
    if elements is None:
        return np.ones(len(P_m))
    areas = _nearest_areas(P_m, nearest or elements)
    # The midpoints of the edges of triangles integrate quadratic functions exactly.
    places = (elements.corners + np.roll(elements.corners, 1, axis=1)).reshape(-1, 3) / 2
    if moving.surfaces:
        places, _ = moving.projections(places)
    shares = np.repeat(elements.areas / 3, 3)
    centre = shares @ places / shares.sum()
    size = np.sqrt(shares @ ((places - centre) ** 2).sum(axis=1) / shares.sum())
    of_points, of_places = (_quadratics((positions - centre) / size) for positions in (P_m, places))
    moments = shares @ of_places
    for count in CONDITIONS:
        weights = _with_moments(areas, of_points[:, :count], moments[:count])
        if weights is not None:
            return weights
    return areas


def _with_moments(areas: np.ndarray, functions: np.ndarray, moments: np.ndarray) -> np.ndarray | None:
    """Return the weights (point,) nearest to areas for which functions (point, k) have the sums `moments` (k,), None if none.

    They are w = a max(f, 1 + functions y), with the multipliers y at the least value of the dual problem, which is convex and
    piecewise quadratic: Newton's method finds it in a few steps.
    """

    def dual(y: np.ndarray) -> float:
        factors = 1 + functions @ y
        bounded = np.maximum(factors, LEAST_FACTOR)
        return float(areas @ (bounded * (factors - bounded / 2)) - moments @ y)

    y, value = np.zeros(len(moments)), dual(np.zeros(len(moments)))
    for _ in range(MAX_STEPS):
        factors = 1 + functions @ y
        weights = areas * np.maximum(factors, LEAST_FACTOR)
        missing = moments - weights @ functions
        if np.abs(missing).max() <= MOMENT_TOLERANCE * len(areas):
            return weights
        free = functions * np.sqrt(np.where(factors > LEAST_FACTOR, areas, 0))[:, None]
        step = np.linalg.lstsq(free.T @ free, missing, rcond=1e-12)[0]
        length, slope = 1.0, float(missing @ step)
        while length > 1e-6 and dual(y + length * step) > value - 1e-4 * length * slope + 1e-12 * len(areas):
            length /= 2
        y = y + length * step
        value = dual(y)
    return None


class _Elements(NamedTuple):
    """Triangles of a face: corners (element, 3, 3), areas (element,) whose mean per contact point is 1, and their size [mm]."""

    corners: np.ndarray
    areas: np.ndarray
    size: float


def _elements(
    P_m: np.ndarray,
    distance: float,
    moving: Surface,
    reference: Surface,
    region: np.ndarray | None = None,
    *,
    is_fine: bool = True,
) -> _Elements | None:
    """Return the elements of the part of the moving face that counts; None if there are none.

    region    triangles (triangle, 3, 3) of the face over the reference face; without them each element is over it or not
    is_fine   whether elements are also small where a whole region counts
    """
    size = max(moving.mesh.area / min(ELEMENTS_PER_POINT * len(P_m), MAX_ELEMENTS), 0.0) ** 0.5
    vertices, faces = moving.vertices, moving.faces
    if region is not None:
        vertices, faces = region.reshape(-1, 3), np.arange(3 * len(region)).reshape(-1, 3)
    if not len(faces):
        return None
    corners = vertices[faces]
    if is_fine or not _is_within(corners.reshape(-1, 3), reference, distance + size):
        vertices, faces, _ = face_frame(moving.mesh).subdivided(vertices, faces, EDGE * size)
        corners = vertices[faces]
        middles = corners.mean(axis=1)
        feet, is_over = reference.projections(middles)
        corners = corners[(is_over | (region is not None)) & (np.linalg.norm(middles - feet, axis=1) <= distance + size)]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    if not areas.sum() > 0:
        return None
    return _Elements(corners, areas / areas.sum() * len(P_m), size)


def _is_within(points: np.ndarray, reference: Surface, distance: float) -> bool:
    """Return whether the convex hull of points (point, 3) over a flat reference face is within a distance [mm] of it."""
    n = reference.corner_normals.reshape(-1, 3).mean(axis=0)
    heights, levels = points @ n, reference.vertices @ n
    return bool(max(heights.max() - levels.min(), levels.max() - heights.min()) <= distance * np.linalg.norm(n))


def _nearest_areas(P_m: np.ndarray, elements: _Elements) -> np.ndarray:
    """Return the area (point,) that is nearest to each point."""
    distances, nearest = KDTree(P_m).query(elements.corners.mean(axis=1), k=np.arange(1, min(len(P_m), NEIGHBOURS) + 1))
    # An element equally near to several points is shared, so that rounding in another frame changes nothing.
    ties = distances <= distances[:, :1] + TIE * elements.size
    shares = ties * (elements.areas / ties.sum(axis=1))[:, None]
    return np.bincount(nearest.ravel(), weights=shares.ravel(), minlength=len(P_m))


def _quadratics(x: np.ndarray) -> np.ndarray:
    """Return 1, the coordinates x (n, 3), and their products (n, 10)."""
    u, v, w = x.T
    return np.column_stack([np.ones(len(x)), u, v, w, u * u, u * v, u * w, v * v, v * w, w * w])
