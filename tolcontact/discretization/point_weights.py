"""The region of faces that an objective counts, and the weights of contact points: the areas of it that they represent."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree
from trimesh import triangles

from tolcontact.arrays import Array, Float
from tolcontact.geometry.overlap import opposite
from tolcontact.geometry.spreading import face_frame
from tolcontact.geometry.surface import Surface

ELEMENTS_PER_POINT = 16
MAX_ELEMENTS = 200_000
MOST_POINTS = 1000  # whose elements represent faces with too many triangles to cut
EDGE = 2.0137  # of the largest edge of an element, in its size: no edge of a model is just as long as that
NEIGHBOURS = 8  # at most, which share an element that is equally near to them
TIE = 1e-6  # of the size of an element
LEAST_FACTOR = 0.1  # smallest ratio of a weight to the area that the point represents
MOMENT_TOLERANCE = 1e-11  # of the moments of weights of mean 1, in the size of the face
MAX_STEPS = 60
CONDITIONS = (10, 4)  # moments of the orders 0 to 2, or of 0 and 1


class CountedRegion(NamedTuple):
    """The part of a face that is opposite to another one: its area [mm^2], places (place, 3) [mm], and their `shares` (place,).

    Sums over places with their shares [mm^2] are integrals of quadratic functions: exact for polyhedra.
    """

    places: Float[Array, "place 3"]
    shares: Float[Array, " place"]

    @property
    def area(self) -> float:
        """The area [mm^2]; where the faces are not parallel, it counts by the cosine of the angle between them."""
        return float(self.shares.sum())


def counted_region(face: Surface | None, target: Surface | None, within: float) -> CountedRegion | None:
    """Return the part of a face that an objective counts; None without faces, or if there is no such part.

    It is over the target, along the normals of the target, and faces it `within` a distance [mm].
    """
    if face is None or target is None:
        return None
    elements = _exact_elements(face, target, within) or _elements(MOST_POINTS, within, face, target, by_cosines=True)
    return None if elements is None else _region(elements, face)


def point_weights(
    P_m: Float[Array, "point 3"], P_r: Float[Array, "point 3"], moving: Surface, reference: Surface
) -> Float[Array, " point"]:
    """Return weights (point,) in proportion to the area of the moving face that is nearest to each point; their mean is 1.

    Only the part of the face over the reference face counts, up to the distance of the farthest point from its foot P_r.
    Weights have the moments of this part: its area, its centre, and its second moments. They are as close as possible to the
    nearest areas a, by the sum of (w - a)^2 / a, and each is at least a tenth of its area. With few points this may be
    impossible: then they have area and centre, or the area alone.
    """
    # Areas of triangles that are cut along the reference face would depend on its tessellation; their moments do not.
    nearest = _elements(len(P_m), float(np.linalg.norm(P_m - P_r, axis=1).max()), moving, reference)
    everywhere = moving.mesh.scale + reference.mesh.scale
    exact = _exact_elements(moving, reference, everywhere) if moving.is_flat and reference.is_flat else None
    elements = exact or nearest
    if elements is None:
        return np.ones(len(P_m))
    areas = _nearest_areas(P_m, nearest or elements)
    places, shares = _region(elements, moving)
    shares = shares / shares.sum() * len(P_m)
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
    """Triangles of a face: corners (element, 3, 3), the areas (element,) [mm^2] that count, and their size [mm]."""

    corners: np.ndarray
    areas: np.ndarray
    size: float


def _exact_elements(face: Surface, target: Surface, within: float) -> _Elements | None:
    """Return the triangles that are opposite to a target; None if there are none, or too many."""
    region = opposite(face, target, within)
    if region is None or not len(region[0]):
        return None
    corners, cosines = region
    return _Elements(corners, triangles.area(corners) * cosines, 0.0)


def _elements(count: int, distance: float, face: Surface, target: Surface, *, by_cosines: bool = False) -> _Elements | None:
    """Return small elements of a face, for a number of points, over a target up to a distance [mm]; None if there are none.

    If `by_cosines`, their areas count by the cosine of the angle between both faces.
    """
    size = max(face.mesh.area / min(ELEMENTS_PER_POINT * count, MAX_ELEMENTS), 0.0) ** 0.5
    vertices, faces, _ = face_frame(face.mesh).subdivided(face.vertices, face.faces, EDGE * size)
    corners = vertices[faces]
    middles = corners.mean(axis=1)
    feet, normals, is_over = target.project(middles)
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    areas = np.maximum(-(crossed * normals).sum(axis=1), 0.0) if by_cosines else np.linalg.norm(crossed, axis=1)
    counts = is_over & (np.linalg.norm(middles - feet, axis=1) <= distance + size) & (areas > 0)
    return _Elements(corners[counts], areas[counts], size) if counts.any() else None


def _region(elements: _Elements, face: Surface) -> CountedRegion:
    # The midpoints of the edges of triangles integrate quadratic functions exactly.
    places = (elements.corners + np.roll(elements.corners, 1, axis=1)).reshape(-1, 3) / 2
    if face.surfaces:
        places = face.project(places)[0]
    return CountedRegion(places, np.repeat(elements.areas / 3, 3))


def _nearest_areas(P_m: np.ndarray, elements: _Elements) -> np.ndarray:
    """Return the area (point,) that is nearest to each point."""
    distances, nearest = KDTree(P_m).query(elements.corners.mean(axis=1), k=np.arange(1, min(len(P_m), NEIGHBOURS) + 1))
    # An element equally near to several points is shared, so that rounding in another frame changes nothing.
    ties = distances <= distances[:, :1] + TIE * elements.size
    shares = ties * (elements.areas / elements.areas.sum() * len(P_m) / ties.sum(axis=1))[:, None]
    return np.bincount(nearest.ravel(), weights=shares.ravel(), minlength=len(P_m))


def _quadratics(x: np.ndarray) -> np.ndarray:
    """Return 1, the coordinates x (n, 3), and their products (n, 10)."""
    u, v, w = x.T
    return np.column_stack([np.ones(len(x)), u, v, w, u * u, u * v, u * w, v * v, v * w, w * w])
