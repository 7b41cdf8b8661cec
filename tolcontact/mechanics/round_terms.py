"""The gap of one ball or shaft against a wall, and its derivatives by the coordinates of the ball or shaft.

A flat wall, or one around a shaft, keeps the shaft on one side of its tangent planes. Let e be the direction from the shaft to
a tangent plane. A shaft that ends in a circle with centre c, axis a and radius r extends to e.c + r sqrt(1 - (e.a)^2) along e:
the extreme point of the circle. A shaft longer than its wall is cut in the plane where the wall ends, with normal u across e.
The cut is an ellipse about the point c of the axis, and extends to e.c + r sqrt(1 + (e.a / u.a)^2). The gap in a hollow
cylinder is the gap to its nearest tangent plane.
"""

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from tolcontact.discretization import RoundPoint
from tolcontact.geometry.analytic_surfaces import Cone, Sphere, Torus

NEWTON_STEPS = 6  # from the tangent nearest to a shaft that is parallel to the wall
MAX_ROTATION = 0.5  # rad: largest Newton step
AXIS_OFFSET = 1e-13  # mm: assumed distance of a point on an axis from it
MIN_FREEDOM = 1e-3  # of the ball's or shaft's radius: smallest freedom for which curvature is computed
MIN_MISSING = 1e-9  # rad: smallest missing half arc of an incomplete wall


class Terms(NamedTuple):
    """The gap [mm] of a point, and its derivatives by the `n` coordinates of the ball or shaft.

    slope     (1, n)
    bend      (n, n): the second derivative, without the term that a closing wall subtracts: closing * sliding' sliding
    sliding   (k, n)
    closing   (1, 1)
    """

    gap: ca.SX
    slope: ca.SX
    bend: ca.SX
    sliding: ca.SX
    closing: ca.SX


def round_terms(point: RoundPoint, coordinates: ca.SX, station: float, growths: ca.SX) -> Terms:
    """Return the terms of a point of a ball or a shaft.

    coordinates   (n, 1): the ball's centre, or an axis point of the shaft and the axis
    station       [mm]: position of the point along the axis, from the axis point in `coordinates`
    growths       (2, 1) [mm]: growth of the body, ball or shaft, and of the wall
    """
    if point.wall.kind == "plane" or point.axis.any():
        return _tangent_terms(point, coordinates, station, growths)
    return _ball_terms(point, coordinates, growths)


def _tangent_terms(point: RoundPoint, coordinates: ca.SX, station: float, growths: ca.SX) -> Terms:
    """Return the terms of a point against a plane, or of a shaft in a hollow cylinder."""
    wall = point.wall
    tangent = _tangent(wall.kind == "plane", bool(point.cut.any()), bool(point.axis.any()), _arc(point) is None)
    sizes = [point.radius, wall.radius, point.opening, station]
    numbers = np.concatenate([point.centre, point.cut, wall.origin, wall.axis, point.towards, sizes])
    return Terms(*tangent.call([coordinates, growths, ca.SX(ca.DM(numbers))]))


@functools.cache
def _tangent(is_flat: bool, is_cut: bool, has_axis: bool, is_whole: bool) -> ca.Function:
    """Return the terms of a point at a plane or a hollow cylinder as a Function of coordinates, both growths, and constants.

    The gap is written for a tangent plane with normal e, rotated by `delta` towards t. A plane is its own tangent plane. For a
    hollow wall it is the nearest tangent plane: e* with d gap / d delta = 0. As the shaft's coordinates s change, e* rotates,
    which lowers the second derivative by (d2 gap / ds d delta)^2 / (d2 gap / d delta2), unless e* is at the end of the wall.
    """
    s, growths, numbers = ca.SX.sym("coordinates", 6 if has_axis else 3), ca.SX.sym("growths", 2), ca.SX.sym("numbers", 19)
    centre, u, o, w, x, sizes = ca.vertsplit(numbers, [0, 3, 6, 9, 12, 15, 19])
    r, wall_radius, opening, station = ca.vertsplit(sizes)
    c, a, tilt = s[:3], s[3:] if has_axis else ca.SX(3, 1), ca.SX(0)
    c = c + station * a
    if is_cut:
        c = c + a * (ca.dot(u, centre - c) / ca.dot(u, a))
        tilt = 1 / ca.dot(u, a) ** 2
    elif has_axis:
        tilt = ca.SX(-1)
    e, t, delta = ca.SX.sym("e", 3), ca.SX.sym("t", 3), ca.SX.sym("delta")
    across = e * ca.cos(delta) + t * ca.sin(delta)
    gap = wall_radius - growths[1] - ca.dot(across, c - o) - (r + growths[0]) * ca.sqrt(1 + tilt * ca.dot(across, a) ** 2)
    slope, slide = ca.jacobian(gap, s), ca.jacobian(gap, delta)
    bend, sliding, stiffness = ca.hessian(gap, s)[0], ca.jacobian(slide, s), ca.jacobian(slide, delta)
    symbols = [e, t, delta]
    if is_flat:
        flat = _put([gap, slope, bend], symbols, [-w, ca.SX.zeros(3), ca.SX(0)])
        return ca.Function("flat", [s, growths, numbers], [*flat, ca.SX(0, s.numel()), ca.SX(0)])
    inputs = [s, growths, numbers]
    slide_slopes = ca.Function("slide_slopes", [*inputs, e, t], _put([slide, stiffness], [delta], [ca.SX(0)]))
    arc = None if is_whole else _Arc(x, opening, ca.cross(w, x), is_cap=False)
    min_stiffness = MIN_FREEDOM * r * 1e-3
    nearest, is_free = _nearest_tangent(lambda e, t: slide_slopes.call([*inputs, e, t]), min_stiffness, c - o, w, x, arc)
    closing = is_free / ca.fmax(stiffness, ca.fmax(ca.fabs(wall_radius - r - growths[1] - growths[0]), MIN_FREEDOM * r))
    terms = _put([gap, slope, bend, sliding, closing], symbols, [nearest, ca.cross(w, nearest), ca.SX(0)])
    return ca.Function("hollow", inputs, terms)


def _put(expressions: list[ca.SX], symbols: list[ca.SX], values: list[ca.SX]) -> list[ca.SX]:
    """Return expressions with symbols replaced by values."""
    return list(ca.substitute(expressions, symbols, values))  # type: ignore[arg-type]


class _Arc(NamedTuple):
    """The arc of an incomplete hollow wall: a cylinder, a cone, or a cap of a sphere.

    towards      (3, 1) unit vector to the midpoint of the arc
    opening      [rad] half the angle of the arc
    transverse   (3, 1) unit vector across `towards`, and across the axis of a cylinder or cone
    """

    towards: ca.SX
    opening: ca.SX
    transverse: ca.SX
    is_cap: bool


def _arc(point: RoundPoint) -> _Arc | None:
    """Return the arc of a wall; None if it is complete, or not hollow."""
    if point.opening > np.pi - MIN_MISSING or not point.is_hollow:
        return None
    is_cap = isinstance(point.wall, Sphere)
    transverse = np.linalg.svd(point.towards[None])[2][1] if is_cap else np.cross(point.wall.axis, point.towards)
    return _Arc(ca.SX(ca.DM(point.towards)), ca.SX(float(point.opening)), ca.SX(ca.DM(transverse)), is_cap)


def _within(arc: _Arc | None, e: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the direction (3, 1) of a hollow wall that is nearest to e, and 1 if it is e, else 0."""
    if arc is None:
        return e, ca.SX(1)
    x, transverse = arc.towards, arc.transverse
    is_free = ca.dot(e, x) >= ca.cos(arc.opening)
    if arc.is_cap:
        _, side = _direction(_across(x, e) + AXIS_OFFSET * transverse)
    else:
        side = ca.if_else(ca.dot(e, transverse) < 0, -1, 1) * transverse
    return ca.if_else(is_free, e, ca.cos(arc.opening) * x + ca.sin(arc.opening) * side), ca.if_else(is_free, 1, 0)


def _nearest_tangent(
    slide_slopes: Callable[[ca.SX, ca.SX], Sequence[ca.SX]],
    min_stiffness: ca.SX,
    q: ca.SX,
    w: ca.SX,
    x: ca.SX,
    arc: _Arc | None,
) -> tuple[ca.SX, ca.SX]:
    """Return the outward unit vector (3, 1) of the wall's nearest tangent plane, and 0 if the wall ends there, else 1.

    slide_slopes   first and second derivative of the gap for a rotation of e towards t, as a function of both
    q              (3, 1) from the wall's axis to the shaft's axis
    w, x           (3, 1): the axis of the wall, and the direction of the tangent for a shaft on this axis
    """
    _, e = _direction(_across(w, q) + AXIS_OFFSET * x)
    _, e = _direction(_across(w, e))  # rounding leaves a component along the axis, which matters if the shaft is hardly off it
    e, is_free = _within(arc, e)
    for _ in range(NEWTON_STEPS):
        t = ca.cross(w, e)
        slope_along, stiffness = slide_slopes(e, t)
        newton = ca.fmin(ca.fmax(-slope_along / ca.fmax(stiffness, min_stiffness), -MAX_ROTATION), MAX_ROTATION)
        step = ca.if_else(
            stiffness > min_stiffness, newton, ca.if_else(slope_along > 0, -MAX_ROTATION, MAX_ROTATION)
        )  # away from the furthest tangent, a maximum
        _, e = _direction(e + step * t)
        e, is_free = _within(arc, e)
    return e, is_free


def _ball_terms(point: RoundPoint, centre: ca.SX, growths: ca.SX) -> Terms:
    """Return the terms of a ball against a curved wall."""
    side = -1.0 if point.is_hollow else 1.0
    growth = growths[0] + growths[1]
    distance, normal, bend, around, stiffness = _distance(point, centre, growth)
    gap = side * distance - float(point.radius) - growths[0] - growths[1]
    if point.is_hollow:
        return Terms(gap, side * normal.T, bend, around, stiffness)
    return Terms(gap, side * normal.T, around.T @ around * stiffness + bend, ca.SX(0, 3), ca.SX(0))


def _distance(point: RoundPoint, c: ca.SX, growth: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return the distance of a point c (3, 1) from the wall [mm], its gradient (3, 1) and second derivative (3, 3) in parts.

    It is AnalyticSurface.distance, or for an incomplete hollow wall the distance from the nearest of its tangent planes. The
    second derivative is B + k A'A, in the order B, A, k. It depends on the freedom between ball and wall, and so on their
    total `growth` [mm].
    """
    wall, w, x, arc = point.wall, ca.DM(point.wall.axis), ca.DM(point.towards), _arc(point)
    r, nothing = float(point.radius), ca.SX(3, 3)
    p = c - ca.DM(wall.origin)
    min_length = ca.fmax(ca.fabs(float(wall.radius) - r - growth), MIN_FREEDOM * r)
    if isinstance(wall, Sphere):
        _, n = _direction(p + AXIS_OFFSET * x)
        n, is_free = _within(arc, n)
        length, around = ca.dot(n, p), ca.SX.eye(3) - n @ n.T
        stiffness = 1 / ca.fmax(length, min_length)
        if arc is not None:  # along the rim, if the wall ends there
            rim = ca.vertcat(ca.cross(x, n).T, ca.SX(2, 3))
            around, along = ca.if_else(is_free, around, rim), ca.norm_2(_across(x, p)) * np.sin(point.opening)
            stiffness = ca.if_else(is_free, stiffness, 1 / ca.fmax(along, MIN_FREEDOM * r))
        return wall.height(length, 0.0), n, nothing, around, stiffness
    along = ca.dot(w, p)
    _, outward = _direction(_across(w, p) + AXIS_OFFSET * x)
    _, outward = _direction(_across(w, outward))
    outward, is_free = _within(arc, outward)
    length, t = ca.dot(outward, p), ca.cross(w, outward)
    if isinstance(wall, Torus):
        tube, n = _direction(wall.from_circle(length, outward, along, w))
        curvature = ca.dot(n, outward) / ca.fmax(length, MIN_FREEDOM * r)
        return wall.height(tube, along), n, curvature * t @ t.T, ca.cross(t, n).T, 1 / ca.fmax(tube, MIN_FREEDOM * r)
    if isinstance(wall, Cone):
        cos = np.cos(wall.angle)
        n = cos * outward - np.sin(wall.angle) * w
        return wall.height(length, along), n, nothing, t.T, is_free * cos / ca.fmax(length, MIN_FREEDOM * r)
    return wall.height(length, along), outward, nothing, t.T, is_free / ca.fmax(length, min_length)


def _across(w: ca.SX | ca.DM, vector: ca.SX) -> ca.SX:
    """Return the component of a vector (3, 1) across the unit vector w."""
    return vector - w * ca.dot(w, vector)


def _direction(vector: ca.SX) -> tuple[ca.SX, ca.SX]:
    length = ca.norm_2(vector)
    return length, vector / length
