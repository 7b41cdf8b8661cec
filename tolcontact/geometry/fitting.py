"""Planes, cylinders, cones and spheres fitted to the corners of triangles, where a file states no surface. Lengths in mm."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import scipy

from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Cone, Cylinder, Plane, Sphere

MIN_DIRECTIONS = 5  # of facets: with fewer, a surface is a fold, not round
MIN_SPARE = 2  # vertices beyond the numbers of a round surface: it passes through as many vertices as it has numbers anyway
NORMAL_TOLERANCE = 1e-9  # normals that differ by less are one direction
MIN_CONE_ANGLE = 1e-4  # rad: between a cone and its axis, and between a cone and the plane across it
SAMPLED_TRIANGLES = 300  # triangles in a first trial
SAMPLE_TOLERANCE = 10  # times the tolerance: largest residual in the first trial
RADIUS_TOLERANCE = 0.1  # of the residual of a surface: uncertainty of its radius
EXACT = 1e-14  # of a size: residual that is due to rounding
DIFFERENCE = 1e-8  # of the size of a variable: step of finite differences
MAX_DIGITS = 12  # decimals of a radius
MAX_SIZE = 1e4  # largest radius, in sizes of the fitted vertices; larger radii are the rounding of a plane


def fit_surface(triangles: np.ndarray, tolerance: float) -> AnalyticSurface | None:
    """Return a surface within `tolerance` [mm] of the corners of `triangles` (face, 3, 3) [mm], if there is one.

    Both a sphere and a cone pass through two rings of vertices: the simpler one is used. Triangles in fewer than
    MIN_DIRECTIONS directions are a plane or a fold, and a round surface needs MIN_SPARE vertices that do not determine it.
    Fasteners, features and contact pairs request the same faces, and parts of one shape share them: a face is fitted once.
    """
    return _fit(np.asarray(triangles, dtype=float).tobytes(), tolerance)


@lru_cache(maxsize=256)
def _fit(corner_bytes: bytes, tolerance: float) -> AnalyticSurface | None:
    triangles = np.frombuffer(corner_bytes).reshape(-1, 3, 3)
    vertices = _vertices(triangles)
    if len(vertices) < 4:
        return None
    is_bent = len(np.unique(np.round(_normals(triangles) / NORMAL_TOLERANCE), axis=0)) < MIN_DIRECTIONS
    trials = [(vertices, triangles, tolerance)]
    if len(triangles) > SAMPLED_TRIANGLES:  # a few triangles rule out most surfaces at once
        sample = triangles[np.linspace(0, len(triangles) - 1, SAMPLED_TRIANGLES).astype(int)]
        trials.insert(0, (_vertices(sample), sample, tolerance * SAMPLE_TOLERANCE))
    fits = [fit for fit, numbers in FITS.items() if len(vertices) >= numbers + MIN_SPARE or fit is fit_plane]
    for fit in fits[:1] if is_bent else fits:
        for corners, faces, limit in trials:
            surface = fit(corners, faces)
            if surface is None or surface.residual > limit:
                break
        else:
            return surface
    return None


def _vertices(triangles: np.ndarray) -> np.ndarray:
    """Return the distinct corners (vertex, 3) of triangles."""
    return np.unique(triangles.reshape(-1, 3), axis=0)


def nearest_surface(triangles: np.ndarray) -> AnalyticSurface:
    """Return the plane, cylinder, cone or sphere that is nearest to `triangles` (face, 3, 3) [mm]."""
    vertices = _vertices(triangles)
    samples = np.vstack([vertices, triangles.mean(axis=1)])  # two rings of vertices alone also lie on a sphere
    surfaces = [fit(vertices, triangles) for fit in FITS]
    return min(
        (surface for surface in surfaces if surface is not None), key=lambda surface: np.abs(surface.distance(samples)[0]).max()
    )


def _normals(triangles: np.ndarray) -> np.ndarray:
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)


def fit_plane(vertices: np.ndarray, triangles: np.ndarray) -> AnalyticSurface:
    """Return the plane through the mean of `vertices` (vertex, 3) with the least sum of squared distances."""
    centre = vertices.mean(axis=0)
    axis = np.linalg.svd(vertices - centre, full_matrices=False)[2][2]
    return _with_residual(Plane(centre, axis), vertices)


def fit_cylinder(vertices: np.ndarray, triangles: np.ndarray) -> AnalyticSurface | None:
    """Return the cylinder that fits `vertices` (vertex, 3) best, None if there is none.

    The normals of a cylinder are perpendicular to its axis: the start is the direction of their smallest components.
    """
    _, spread, directions = np.linalg.svd(_normals(triangles), full_matrices=False)
    if spread[1] < 1e-3 * spread[0]:
        return None
    e1, e2, axis = directions
    centre, size = vertices.mean(axis=0), float(np.ptp(vertices, axis=0).max())
    across = (vertices - centre) @ np.column_stack([e1, e2])
    x, y, r = _circle(across)

    def cylinder(numbers: np.ndarray) -> Cylinder:
        tilt, turn, x, y, radius = numbers
        direction = axis + tilt * e1 + turn * e2
        direction /= np.linalg.norm(direction)
        return Cylinder(centre + x * e1 + y * e2, direction, radius=abs(float(radius)))

    solution = _least_squares(
        lambda numbers: cylinder(numbers).distance(vertices)[0], [0.0, 0.0, x, y, r], [1e-3, 1e-3, size, size, size]
    )
    return _with_residual(cylinder(solution), vertices) if abs(solution[4]) < MAX_SIZE * size else None


def fit_cone(vertices: np.ndarray, triangles: np.ndarray) -> AnalyticSurface | None:
    """Return the cone that fits `vertices` (vertex, 3) best, None if there is none.

    The normals of a cone form a constant angle with its axis, and its tangent planes meet in its apex.
    """
    normals = _normals(triangles)
    _, spread, directions = np.linalg.svd(normals - normals.mean(axis=0), full_matrices=False)
    if spread[1] < 1e-3 * spread[0]:
        return None
    e1, e2, axis = directions
    size = float(np.ptp(vertices, axis=0).max())
    apex = np.linalg.lstsq(normals, (normals * triangles[:, 0]).sum(axis=1), rcond=None)[0]
    axis = axis * np.sign((vertices - apex).mean(axis=0) @ axis)
    along = (vertices - apex) @ axis
    angle = float(np.arctan2(np.linalg.norm(vertices - apex - along[:, None] * axis, axis=1), along).mean())

    def cone(numbers: np.ndarray) -> Cone:
        direction = axis + numbers[0] * e1 + numbers[1] * e2
        return Cone(apex + numbers[2:5], direction / np.linalg.norm(direction), angle=float(numbers[5]))

    is_cone = MIN_CONE_ANGLE < angle < np.pi / 2 - MIN_CONE_ANGLE
    if not (is_cone and np.linalg.norm(apex - vertices[0]) < MAX_SIZE * size):
        return None
    solution = _least_squares(
        lambda numbers: cone(numbers).distance(vertices)[0],
        [0.0, 0.0, 0.0, 0.0, 0.0, angle],
        [1e-3, 1e-3, size, size, size, 1e-3],
    )
    return _with_residual(cone(solution), vertices) if 0 < solution[5] < np.pi / 2 else None


def fit_sphere(vertices: np.ndarray, triangles: np.ndarray) -> AnalyticSurface | None:
    """Return the sphere that fits `vertices` (vertex, 3) best, None if it is far too large."""
    centre, size = vertices.mean(axis=0), float(np.ptp(vertices, axis=0).max())
    offset = vertices - centre
    linear = np.linalg.lstsq(np.column_stack([2 * offset, np.ones(len(offset))]), (offset**2).sum(axis=1), rcond=None)[0]
    start = [*linear[:3], np.sqrt(max(linear[3] + (linear[:3] ** 2).sum(), 0.0))]
    if not start[3] < MAX_SIZE * size:
        return None
    solution = _least_squares(lambda numbers: np.linalg.norm(offset - numbers[:3], axis=1) - numbers[3], start, size)
    sphere = Sphere(centre + solution[:3], np.array([0.0, 0.0, 1.0]), radius=abs(float(solution[3])))
    return _with_residual(sphere, vertices)


# From the simplest to the most general, with how many numbers each is determined by; all except the plane are round.
FITS: dict[Callable[[np.ndarray, np.ndarray], AnalyticSurface | None], int] = {
    fit_plane: 3,
    fit_cylinder: 5,
    fit_cone: 6,
    fit_sphere: 4,
}


def _least_squares(
    residuals: Callable[[np.ndarray], np.ndarray], start: Sequence[float], scale: Sequence[float] | float
) -> np.ndarray:
    """Return the variables (n,) with the least sum of squared residuals [mm], from a start; `scale` states their sizes.

    Where vertices are exact, so is the start except for its rounding, and one Gauss-Newton step removes this rounding.
    """
    numbers, sizes = np.array(start), np.broadcast_to(scale, len(start))
    errors = residuals(numbers)
    if np.abs(errors).max() > EXACT * sizes.max():
        best = scipy.optimize.least_squares(residuals, start, x_scale=scale, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=50)
        return np.asarray(best.x)
    changes = DIFFERENCE * sizes
    slopes = [residuals(numbers + change) - errors for change in np.diag(changes)]
    better = numbers - changes * np.linalg.lstsq(np.column_stack(slopes), errors, rcond=None)[0]
    return better if np.linalg.norm(residuals(better)) < np.linalg.norm(errors) else numbers


def _circle(points: np.ndarray) -> tuple[float, float, float]:
    """Return centre and radius of the circle that fits `points` (point, 2) best, from linear equations."""
    linear = np.linalg.lstsq(np.column_stack([2 * points, np.ones(len(points))]), (points**2).sum(axis=1), rcond=None)[0]
    x, y, constant = (float(number) for number in linear)
    return x, y, float(np.sqrt(max(constant + x**2 + y**2, 0.0)))


def _with_residual(surface: AnalyticSurface, vertices: np.ndarray) -> AnalyticSurface:
    """Return the surface with its residual over `vertices` (vertex, 3), and with a rounded radius if they permit one."""
    residual = float(np.abs(surface.distance(vertices)[0]).max())
    if isinstance(surface, Cylinder | Sphere):
        rounded = (round(surface.radius, digits) for digits in range(MAX_DIGITS))
        radius = next((r for r in rounded if abs(r - surface.radius) <= RADIUS_TOLERANCE * residual), surface.radius)
        surface = replace(surface, radius=radius)
    return replace(surface, residual=float(np.abs(surface.distance(vertices)[0]).max()), is_fitted=True)
