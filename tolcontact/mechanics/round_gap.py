"""Gaps of round faces at any pose: a ball's centre, or the ends of a shaft's axis, beside a wall.

A flat wall, or one around a shaft, keeps the shaft on one side of its tangent planes. Let e be the direction from the shaft to
a tangent plane. A shaft that ends in a circle with centre c, axis a and radius r extends to e.c + r sqrt(1 - (e.a)^2) along e:
the extreme point of the circle. A shaft longer than its wall is cut in the plane where the wall ends, with normal u across e.
The cut is an ellipse about the point c of the axis, and extends to e.c + r sqrt(1 + (e.a / u.a)^2). Of all tangent planes of a
hollow cylinder the nearest one counts.
"""

import functools

import casadi as ca
import numpy as np

from tolcontact.discretization import RoundPoint, RoundPoints
from tolcontact.geometry.analytic_surfaces import Cone, Sphere, Torus
from tolcontact.mechanics.pose import ENTRIES, Pose, pose_of

NEWTON_STEPS = 6  # from the tangent that is nearest to an upright shaft
MAX_TURN = 0.5  # rad: largest Newton step
AXIS_OFFSET = 1e-13  # mm: assumed distance of a point on an axis from it
MIN_FREEDOM = 1e-3  # of the ball's or shaft's radius: smallest freedom for which curvature is computed
TOLERANCE = 1e-9
TANGENT_TOLERANCE = 0.05  # rad: tangents within this angle count as one

Terms = tuple[ca.SX, ca.SX, ca.SX, ca.SX]  # of a point: gap, slope, second derivative, and how its wall closes in


@functools.lru_cache(64)  # rows of the QP and gaps of all points are made of the same expressions
def round_gaps(points: RoundPoints) -> ca.Function:
    """Return the gaps of round points as a Function.

    Its inputs are X_RM (12), heights (2) by which the moving and the reference face have grown, and reactions (point). Results:

    gaps     (point) [mm]; where two tangents nearly agree, both have the gap of the nearer one
    slopes   (point, 12): their derivatives by X_RM
    bow      (12, 12): the sum of reactions times their second derivatives, without `wrap`
    wrap     (12, 12): the sum of reactions times the second derivatives that are due to bodies sliding along hollow walls;
                       positive semidefinite, and to be subtracted from `bow`
    distances  (point) [mm]: the gap of each point itself
    """
    X, grown, reactions = (
        ca.SX.sym(name, size) for name, size in (("X_RM", ENTRIES), ("heights", 2), ("reactions", len(points)))
    )
    gaps, slopes, distances = [], [], []
    nearest: tuple[RoundPoint, Terms] | None = None  # the last tangent that turns along a hollow wall
    bow, wrap = ca.SX.zeros(ENTRIES, ENTRIES), ca.SX.zeros(ENTRIES, ENTRIES)
    for point, reaction in zip(points, ca.vertsplit(reactions), strict=True):
        body_height, wall_height = (grown[0], grown[1]) if point.on_moving else (grown[1], grown[0])
        gap_terms = (_tangent_terms if _has_tangents(point) else _ball_terms)(point, X, body_height, wall_height)
        distances.append(gap_terms[0])
        if point.is_hollow:
            nearest = (point, gap_terms)
        elif nearest is not None and _touches(point, nearest[0]):
            gap_terms = _tangent_or_nearest(gap_terms, nearest[1])
        gap, slope, bend, closing = gap_terms
        gaps.append(gap)
        slopes.append(slope)
        bow += reaction * bend
        wrap += reaction * closing
    outputs = {"gaps": ca.vertcat(*gaps), "slopes": ca.vertcat(*slopes), "bow": bow, "wrap": wrap}
    outputs["distances"] = ca.vertcat(*distances)
    inputs = {"X_RM": X, "heights": grown, "reactions": reactions}
    return ca.Function("round_gaps", [*inputs.values()], [*outputs.values()], [*inputs], [*outputs])


def _touches(plane: RoundPoint, hollow: RoundPoint) -> bool:
    """Return whether a plane is a fixed tangent of a hollow wall, for the same ball or the same end of a shaft."""
    wall, n = hollow.wall, plane.wall.axis
    if plane.wall.kind != "plane" or not (plane.centre == hollow.centre).all():
        return False
    offset = float(n @ (plane.wall.origin - wall.origin)) + wall.radius  # n looks inward
    lean = 0.0 if wall.kind == "sphere" else float(n @ wall.axis) - np.sin(wall.angle)
    return abs(offset) < TOLERANCE * plane.radius and abs(lean) < TOLERANCE


def _tangent_or_nearest(fixed: Terms, nearest: Terms) -> Terms:
    """Return a fixed tangent, or the nearest one if both have nearly the same direction.

    Otherwise either could carry, to a solver's accuracy, and the steps would not converge.
    """
    is_alike = ca.sumsqr(fixed[1] - nearest[1]) < TANGENT_TOLERANCE**2 * ca.sumsqr(fixed[1])
    gap, slope, bend, closing = (ca.if_else(is_alike, b, a) for a, b in zip(fixed, nearest, strict=True))
    return gap, slope, bend, closing


def _has_tangents(point: RoundPoint) -> bool:
    return point.wall.kind == "plane" or bool(point.axis.any())


def _in_wall_frame(point: RoundPoint, X: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return centre and axis (3, 1) of the ball or shaft in the frame of the part that has the wall."""
    pose = pose_of(X)
    if not point.on_moving:
        pose = Pose(pose.R.T, -(pose.R.T @ pose.t))
    return pose.apply(ca.DM(point.centre)), pose.R @ ca.DM(point.axis)


def _tangent_terms(point: RoundPoint, X: ca.SX, body_height: ca.SX, wall_height: ca.SX) -> Terms:
    """Return the terms of a point beside a plane, or of a shaft in a hollow cylinder; the heights are their growth [mm].

    Terms are the gap [mm], its slope (1, 12) and second derivative (12, 12) by X_RM, and the part (12, 12) that a closing wall
    subtracts from it. The gap is written for a tangent plane with normal e, turned by `delta` towards t. A plane is its own
    tangent plane. Of a hollow wall the nearest one counts: e* with d gap / d delta = 0. As X_RM moves, e* turns, which lowers
    the second derivative by (d2 gap / dX d delta)^2 / (d2 gap / d delta2), unless e* stops where the wall ends.
    """
    c, a = _in_wall_frame(point, X)
    o, w, r = ca.DM(point.wall.origin), point.wall.axis, float(point.radius)
    tilt = ca.SX(0)
    if point.cut.any():
        u = ca.DM(point.cut)
        c = c + a * (ca.dot(u, ca.DM(point.centre) - c) / ca.dot(u, a))
        tilt = 1 / ca.dot(u, a) ** 2
    elif point.axis.any():
        tilt = ca.SX(-1)
    both_heights = ca.vertcat(body_height, wall_height)
    e, t, delta = ca.SX.sym("e", 3), ca.SX.sym("t", 3), ca.SX.sym("delta")
    across = e * ca.cos(delta) + t * ca.sin(delta)
    radius = float(point.wall.radius) - wall_height
    gap = radius - ca.dot(across, c - o) - (r + body_height) * ca.sqrt(1 + tilt * ca.dot(across, a) ** 2)
    slope, slide = ca.jacobian(gap, X), ca.jacobian(gap, delta)
    second_derivative, sliding, stiffness = ca.hessian(gap, X)[0], ca.jacobian(slide, X), ca.jacobian(slide, delta)
    symbols = [e, t, delta]
    if point.wall.kind == "plane":
        flat = _put([gap, slope, second_derivative], symbols, [ca.SX(-ca.DM(w)), ca.SX.zeros(3), ca.SX(0)])
        return flat[0], flat[1], flat[2], ca.SX.zeros(ENTRIES, ENTRIES)
    turning = ca.Function("turning", [X, both_heights, e, t], _put([slide, stiffness], [delta], [ca.SX(0)]))
    nearest, is_free = _nearest_tangent(point, turning, X, both_heights, c - o)
    min_stiffness = ca.fmax(ca.fabs(float(point.wall.radius) - r - wall_height - body_height), MIN_FREEDOM * r)
    closing = is_free * sliding.T @ sliding / ca.fmax(stiffness, min_stiffness)
    gap_terms = _put([gap, slope, second_derivative, closing], symbols, [nearest, ca.cross(ca.DM(w), nearest), ca.SX(0)])
    return gap_terms[0], gap_terms[1], gap_terms[2], gap_terms[3]


def _put(expressions: list[ca.SX], symbols: list[ca.SX], values: list[ca.SX]) -> list[ca.SX]:
    """Return expressions with values in place of symbols."""
    return list(ca.substitute(expressions, symbols, values))  # type: ignore[arg-type]


def _nearest_tangent(point: RoundPoint, turning: ca.Function, X: ca.SX, grown: ca.SX, q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the outward unit vector (3, 1) of the wall's nearest tangent plane, and 0 if the wall ends there, else 1.

    turning  Function of X_RM, growth of shaft and wall, e and t: first and second derivative of the gap as e turns towards t
    q        (3, 1) from the wall's axis to the shaft's
    """
    w, x = ca.DM(point.wall.axis), ca.DM(point.towards)
    _, e = _direction(_across(w, q) + AXIS_OFFSET * x)
    _, e = _direction(_across(w, e))  # what rounding left along the axis counts if a shaft is hardly off it
    e, is_free = _within(point, e)
    min_stiffness = MIN_FREEDOM * float(point.radius) * 1e-3
    for _ in range(NEWTON_STEPS):
        t = ca.cross(w, e)
        slope_along, stiffness = turning(X, grown, e, t)
        newton = ca.fmin(ca.fmax(-slope_along / ca.fmax(stiffness, min_stiffness), -MAX_TURN), MAX_TURN)
        step = ca.if_else(
            stiffness > min_stiffness, newton, ca.if_else(slope_along > 0, -MAX_TURN, MAX_TURN)
        )  # away from a farthest tangent
        _, e = _direction(e + step * t)
        e, is_free = _within(point, e)
    return e, is_free


def _within(point: RoundPoint, e: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the direction (3, 1) of a hollow wall that is nearest to e, and 1 if it is e itself, else 0."""
    opening = float(point.opening)
    if opening > np.pi - TOLERANCE or not point.is_hollow:
        return e, ca.SX(1)
    x = ca.DM(point.towards)
    is_free = ca.dot(e, x) >= np.cos(opening)
    if point.wall.kind == "sphere":
        _, aside = _direction(_across(x, e) + AXIS_OFFSET * ca.DM(np.linalg.svd(point.towards[None])[2][1]))
    else:
        y = ca.DM(np.cross(point.wall.axis, point.towards))
        aside = ca.if_else(ca.dot(e, y) < 0, -1, 1) * y
    return ca.if_else(is_free, e, np.cos(opening) * x + np.sin(opening) * aside), ca.if_else(is_free, 1, 0)


def _ball_terms(point: RoundPoint, X: ca.SX, body_height: ca.SX, wall_height: ca.SX) -> Terms:
    """Return the terms of a ball beside a curved wall (see _tangent_terms)."""
    c, _ = _in_wall_frame(point, X)
    side = -1.0 if point.is_hollow else 1.0
    distance, normal, around, fixed_part = _distance(point, c, body_height + wall_height)
    n = ca.SX.sym("n", 3)
    along, J = ca.dot(n, c), ca.jacobian(c, X)
    slope, bend = (
        ca.substitute(expression, n, side * normal) for expression in (ca.jacobian(along, X), ca.hessian(along, X)[0])
    )
    bend += J.T @ fixed_part @ J if point.is_hollow else J.T @ (around + fixed_part) @ J
    closing = J.T @ around @ J if point.is_hollow else ca.SX.zeros(ENTRIES, ENTRIES)
    return side * distance - float(point.radius) - body_height - wall_height, slope, bend, closing


def _distance(point: RoundPoint, c: ca.SX, grown: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return the distance of a point c (3, 1) from the wall [mm], its gradient (3, 1) and second derivative (3, 3) in parts.

    It is AnalyticSurface.distance, or for an incomplete hollow wall the distance from the nearest of its tangent planes. The
    first part of the second derivative is positive semidefinite. It depends on the freedom between ball and wall, which have
    grown by `grown` [mm] together.
    """
    wall, w, x = point.wall, ca.DM(point.wall.axis), ca.DM(point.towards)
    r, nothing = float(point.radius), ca.SX.zeros(3, 3)
    p = c - ca.DM(wall.origin)
    min_length = ca.fmax(ca.fabs(float(wall.radius) - r - grown), MIN_FREEDOM * r)
    if isinstance(wall, Sphere):
        _, n = _direction(p + AXIS_OFFSET * x)
        n, is_free = _within(point, n)
        length, t = ca.dot(n, p), ca.cross(x, n)  # along the rim, if the wall ends there
        along_rim = t @ t.T / ca.fmax(ca.norm_2(_across(x, p)) * np.sin(point.opening), MIN_FREEDOM * r)
        around = (ca.SX.eye(3) - n @ n.T) / ca.fmax(length, min_length)
        return wall.height(length, 0.0), n, ca.if_else(is_free, around, along_rim), nothing
    along = ca.dot(w, p)
    _, outward = _direction(_across(w, p) + AXIS_OFFSET * x)
    _, outward = _direction(_across(w, outward))
    outward, is_free = _within(point, outward)
    length, t = ca.dot(outward, p), ca.cross(w, outward)
    if isinstance(wall, Torus):
        tube, n = _direction(wall.from_circle(length, outward, along, w))
        across = ca.cross(t, n)
        turning = ca.dot(n, outward) / ca.fmax(length, MIN_FREEDOM * r)
        return wall.height(tube, along), n, across @ across.T / ca.fmax(tube, MIN_FREEDOM * r), turning * t @ t.T
    if isinstance(wall, Cone):
        cos = np.cos(wall.angle)
        n = cos * outward - np.sin(wall.angle) * w
        return wall.height(length, along), n, is_free * cos * t @ t.T / ca.fmax(length, MIN_FREEDOM * r), nothing
    return wall.height(length, along), outward, is_free * t @ t.T / ca.fmax(length, min_length), nothing


def _across(w: ca.DM, vector: ca.SX) -> ca.SX:
    """Return the component of a vector (3, 1) across the unit vector w."""
    return vector - w * ca.dot(w, vector)


def _direction(vector: ca.SX) -> tuple[ca.SX, ca.SX]:
    length = ca.norm_2(vector)
    return length, vector / length
