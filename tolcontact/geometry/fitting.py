"""The plane, cylinder, cone or sphere on which given triangles' corners lie, where a file does not state one. Lengths in mm."""

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from tolcontact.geometry.analytic_surfaces import Form

FACETS = 5  # directions of facets at least, from which a round surface is told from a fold
SAME_WAY = 1e-9  # normals that differ by less are one direction
LEAST = 1e-4  # rad: a cone's angle to its axis, and to the plane across it
SOME = 300  # triangles that are looked at first, and
ROUGHLY = 10  # how much farther off their corners may be
SURE = 0.1  # of how far vertices lie off a surface: how far its radius may be off
DIGITS = 12  # of a radius behind the point
LARGE = 1e4  # radii, in sizes of what they are fitted to: more is a plane's rounding


def fitted(triangles: np.ndarray, within: float) -> Form | None:
    """The surface that no corner of `triangles` (face, 3, 3) [mm] is farther off than `within` [mm]; None if none is.

    Between two rings of vertices there is room for a sphere as well as for a cone: it is taken for the simpler one. What looks
    in fewer than FACETS directions is a plane, or bent.
    """
    if len(np.unique(triangles.reshape(-1, 3), axis=0)) < 4:
        return None
    is_bent = len(np.unique(np.round(_normals(triangles) / SAME_WAY), axis=0)) < FACETS
    for attempt in (_plane,) if is_bent else (_plane, _cylinder, _cone, _sphere):
        for some in (_spread(triangles), triangles) if len(triangles) > SOME else (triangles,):
            form = attempt(np.unique(some.reshape(-1, 3), axis=0), some)
            if form is None or form.residual > within * (1 if some is triangles else ROUGHLY):
                break
        else:
            return form
    return None


def nearest(triangles: np.ndarray) -> Form:
    """The plane, cylinder, cone or sphere that `triangles` (face, 3, 3) [mm] are least far off."""
    vertices = np.unique(triangles.reshape(-1, 3), axis=0)
    everywhere = np.vstack([vertices, triangles.mean(axis=1)])  # two rings of vertices alone lie on a sphere, too
    forms = [attempt(vertices, triangles) for attempt in (_plane, _cylinder, _cone, _sphere)]
    return min((form for form in forms if form is not None), key=lambda form: np.abs(form.distance(everywhere)[0]).max())


def _spread(triangles: np.ndarray) -> np.ndarray:
    """Some of them, by which most faces that are none of these surfaces are told at once."""
    return np.asarray(triangles[np.linspace(0, len(triangles) - 1, SOME).astype(int)])


def _normals(triangles: np.ndarray) -> np.ndarray:
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))


def _plane(vertices: np.ndarray, triangles: np.ndarray) -> Form:
    centre = vertices.mean(axis=0)
    axis = np.linalg.svd(vertices - centre, full_matrices=False)[2][2]
    return _with_residual(Form("plane", centre, axis), vertices)


def _cylinder(vertices: np.ndarray, triangles: np.ndarray) -> Form | None:
    """Normals of a cylinder are all across its axis, which therefore is the direction that they have least of."""
    _, spread, directions = np.linalg.svd(_normals(triangles), full_matrices=False)
    if spread[1] < 1e-3 * spread[0]:
        return None
    first, second, axis = directions
    centre, size = vertices.mean(axis=0), float(np.ptp(vertices, axis=0).max())
    across = (vertices - centre) @ np.column_stack([first, second])
    x, y, r = _circle(across)

    def form(numbers: np.ndarray) -> Form:
        tilt, turn, x, y, radius = numbers
        along = axis + tilt * first + turn * second
        along /= np.linalg.norm(along)
        return Form("cylinder", centre + x * first + y * second, along, radius=abs(float(radius)))

    found = least_squares(
        lambda numbers: form(numbers).distance(vertices)[0], [0.0, 0.0, x, y, r], x_scale=[1e-3, 1e-3, size, size, size],
        xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=50,
    )  # fmt: skip
    return _with_residual(form(found.x), vertices) if abs(found.x[4]) < LARGE * size else None


def _cone(vertices: np.ndarray, triangles: np.ndarray) -> Form | None:
    """Normals of a cone make one angle with its axis, and its tangent planes meet in its apex."""
    normals = _normals(triangles)
    _, spread, directions = np.linalg.svd(normals - normals.mean(axis=0), full_matrices=False)
    if spread[1] < 1e-3 * spread[0]:
        return None
    first, second, axis = directions
    size = float(np.ptp(vertices, axis=0).max())
    apex = np.linalg.lstsq(normals, (normals * triangles[:, 0]).sum(axis=1), rcond=None)[0]
    axis = axis * np.sign((vertices - apex).mean(axis=0) @ axis)
    along = (vertices - apex) @ axis
    angle = float(np.arctan2(np.linalg.norm(vertices - apex - along[:, None] * axis, axis=1), along).mean())

    def form(numbers: np.ndarray) -> Form:
        direction = axis + numbers[0] * first + numbers[1] * second
        return Form("cone", apex + numbers[2:5], direction / np.linalg.norm(direction), angle=float(numbers[5]))

    if not (LEAST < angle < np.pi / 2 - LEAST and np.linalg.norm(apex - vertices[0]) < LARGE * size):
        return None
    found = least_squares(
        lambda numbers: form(numbers).distance(vertices)[0], [0.0, 0.0, 0.0, 0.0, 0.0, angle],
        x_scale=[1e-3, 1e-3, size, size, size, 1e-3], xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=50,
    )  # fmt: skip
    return _with_residual(form(found.x), vertices) if 0 < found.x[5] < np.pi / 2 else None


def _sphere(vertices: np.ndarray, triangles: np.ndarray) -> Form | None:
    centre, size = vertices.mean(axis=0), float(np.ptp(vertices, axis=0).max())
    apart = vertices - centre
    solved = np.linalg.lstsq(np.column_stack([2 * apart, np.ones(len(apart))]), (apart**2).sum(axis=1), rcond=None)[0]
    start = [*solved[:3], np.sqrt(max(solved[3] + (solved[:3] ** 2).sum(), 0.0))]
    if not start[3] < LARGE * size:
        return None
    found = least_squares(
        lambda numbers: np.linalg.norm(apart - numbers[:3], axis=1) - numbers[3], start, x_scale=size,
        xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=50,
    )  # fmt: skip
    form = Form("sphere", centre + found.x[:3], np.array([0.0, 0.0, 1.0]), radius=abs(float(found.x[3])))
    return _with_residual(form, vertices)


def _circle(points: np.ndarray) -> tuple[float, float, float]:
    """Centre and radius of the circle next to `points` (point, 2), by algebra."""
    solved = np.linalg.lstsq(np.column_stack([2 * points, np.ones(len(points))]), (points**2).sum(axis=1), rcond=None)[0]
    x, y, rest = (float(number) for number in solved)
    return x, y, float(np.sqrt(max(rest + x**2 + y**2, 0.0)))


def _with_residual(form: Form, vertices: np.ndarray) -> Form:
    """The form, with how far the vertices lie off it; its radius is a round number if they cannot tell."""
    residual = float(np.abs(form.distance(vertices)[0]).max())
    for digits in range(DIGITS):
        radius = round(form.radius, digits)
        if abs(radius - form.radius) <= SURE * residual:
            form = replace(form, radius=radius)
            break
    return replace(form, residual=float(np.abs(form.distance(vertices)[0]).max()), is_fitted=True)
