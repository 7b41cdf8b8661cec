"""Gaps of round faces at any pose: a ball's centre, or the ends of a shaft's axis, beside a wall.

A flat wall, or one around a shaft, keeps the shaft on one side of its tangent planes. Let e be the direction from the shaft to
a tangent plane. A shaft that ends in a circle with centre c, axis a and radius r extends to e.c + r sqrt(1 - (e.a)^2) along e:
the extreme point of the circle. A shaft longer than its wall is cut in the plane where the wall ends, with normal u across e.
The cut is an ellipse about the point c of the axis, and extends to e.c + r sqrt(1 + (e.a / u.a)^2). Of all tangent planes of a
hollow cylinder the nearest one counts.
"""

import functools
from typing import NamedTuple

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


class Terms(NamedTuple):
    """The gap [mm] of a point, and its derivatives by the `n` symbols of the ball or the shaft's end.

    slope     (1, n)
    bend      (n, n): the second derivative
    closing   (n, n): what a closing wall subtracts from it
    """

    gap: ca.SX
    slope: ca.SX
    bend: ca.SX
    closing: ca.SX


@functools.lru_cache(64)  # rows of the QP and gaps of all points are made of the same expressions
def round_gaps(points: RoundPoints, freedoms: int = 0) -> ca.Function:
    """Return the gaps of round points as a Function.

    Its inputs are X_RM (12), heights (2) by which the moving and the reference face have grown, reactions (point), and by_z
    (12, freedoms): the derivatives of X_RM by z, which moves the parts. Results:

    gaps       (point) [mm]; where two tangents nearly agree, both have the gap of the nearer one
    slopes     (point, freedoms): their derivatives by z
    bends      (12): the sum of reactions times their derivatives by X_RM
    bow        (freedoms, freedoms): the sum of reactions times their second derivatives for X_RM linear in z, without `wrap`
    wrap       (freedoms, freedoms): the sum of reactions times the second derivatives that are due to bodies sliding along
               hollow walls; positive semidefinite, and to be subtracted from `bow`
    distances  (point) [mm]: the gap of each point itself
    """
    X, grown, reactions, by_z = (
        ca.SX.sym(name, *shape)
        for name, shape in {
            "X_RM": (ENTRIES, 1), "heights": (2, 1), "reactions": (len(points), 1), "by_z": (ENTRIES, freedoms)
        }.items()
    )  # fmt: skip
    ends: dict[tuple[bool, bytes, bytes], _End] = {}
    gaps, slopes, distances = [], [], []
    loads, terms_of_points = ca.vertsplit(reactions), []
    nearest: int | None = None  # the last tangent that turns along a hollow wall
    known = list(points)
    for k, point in enumerate(known):
        key = (bool(point.on_moving), point.centre.tobytes(), point.axis.tobytes())
        end = ends[key] = ends.get(key) or _End(point, X, by_z)
        body_height, wall_height = (grown[0], grown[1]) if point.on_moving else (grown[1], grown[0])
        of_point = (_tangent_terms if _has_tangents(point) else _ball_terms)(point, end, body_height, wall_height)
        terms_of_points.append((end, of_point))
        gap, slope = of_point.gap, of_point.slope
        distances.append(gap)
        if point.is_hollow:
            nearest = k
        elif nearest is not None and end is terms_of_points[nearest][0] and _touches(point, known[nearest]):
            # Otherwise either could carry, to a solver's accuracy, and the steps would not converge.
            nearer = terms_of_points[nearest][1]
            is_alike = _are_alike(of_point, nearer, end)
            gap, slope = ca.if_else(is_alike, nearer.gap, gap), ca.if_else(is_alike, nearer.slope, slope)
            loads[nearest] += ca.if_else(is_alike, loads[k], 0)
            loads[k] = ca.if_else(is_alike, 0, loads[k])
        gaps.append(gap)
        slopes.append(slope @ end.by_z)
    for (end, of_point), load in zip(terms_of_points, loads, strict=True):
        end.add(of_point, load)
    outputs = {
        "gaps": ca.vertcat(*gaps),
        "slopes": ca.vertcat(*slopes),
        "bends": sum((end.bends() for end in ends.values()), ca.SX.zeros(ENTRIES)),
        "bow": sum((end.bow() for end in ends.values()), ca.SX.zeros(freedoms, freedoms)),
        "wrap": sum((end.wrap() for end in ends.values()), ca.SX.zeros(freedoms, freedoms)),
        "distances": ca.vertcat(*distances),
    }
    symbols, values = [end.symbols for end in ends.values()], [end.place for end in ends.values()]
    inputs = {"X_RM": X, "heights": grown, "reactions": reactions, "by_z": by_z}
    return ca.Function("round_gaps", [*inputs.values()], _put([*outputs.values()], symbols, values), [*inputs], [*outputs])


class _End:
    """A ball, or the end of a shaft, in the frame of the part that has the wall.

    centre, axis   (3, 1) symbols of the ball's centre or the point on the shaft's axis, and of the axis; a ball's axis is 0
    symbols        (n, 1): those of them that vary
    place          (n, 1): their values
    by_X, by_z     (n, 12), (n, z): the derivatives of `place`
    """

    def __init__(self, point: RoundPoint, X: ca.SX, by_z: ca.SX) -> None:
        pose = pose_of(X)
        if not point.on_moving:
            pose = Pose(pose.R.T, -(pose.R.T @ pose.t))
        self.centre, self.axis = ca.SX.sym("centre", 3), ca.SX(3, 1)
        self.symbols, self.place = self.centre, pose.apply(ca.DM(point.centre))
        if point.axis.any():
            self.axis = ca.SX.sym("axis", 3)
            self.symbols = ca.vertcat(self.centre, self.axis)
            self.place = ca.vertcat(self.place, pose.R @ ca.DM(point.axis))
        self.by_X = ca.jacobian(self.place, X)
        self.by_z = self.by_X @ by_z
        self._X, self._X_by_z, size = X, by_z, self.symbols.numel()
        self._slope, self._bend, self._closing = ca.SX(1, size), ca.SX(size, size), ca.SX(size, size)

    def add(self, of_point: "Terms", load: ca.SX) -> None:
        """Add the terms of a point that pushes with a load."""
        self._slope += load * of_point.slope
        self._bend += load * of_point.bend
        self._closing += load * of_point.closing

    def bends(self) -> ca.SX:
        """Return the derivative (12, 1) by X_RM of the sum of loads times gaps."""
        return self.by_X.T @ self._slope.T

    def bow(self) -> ca.SX:
        """Return its second derivative (z, z), without closing walls."""
        weights = ca.SX.sym("weights", self.symbols.numel())
        turning, _ = ca.hessian(ca.dot(weights, self.place), self._X)  # 0 if the place is linear in X_RM
        turning = ca.substitute(turning, weights, self._slope.T)
        return self._X_by_z.T @ turning @ self._X_by_z + self.by_z.T @ self._bend @ self.by_z

    def wrap(self) -> ca.SX:
        """Return the part (z, z) of it that closing walls subtract."""
        return self.by_z.T @ self._closing @ self.by_z


def _touches(plane: RoundPoint, hollow: RoundPoint) -> bool:
    """Return whether a plane is a fixed tangent of a hollow wall."""
    wall, n = hollow.wall, plane.wall.axis
    if plane.wall.kind != "plane":
        return False
    offset = float(n @ (plane.wall.origin - wall.origin)) + wall.radius  # n looks inward
    lean = 0.0 if wall.kind == "sphere" else float(n @ wall.axis) - np.sin(wall.angle)
    return abs(offset) < TOLERANCE * plane.radius and abs(lean) < TOLERANCE


def _are_alike(fixed: Terms, nearest: Terms, end: _End) -> ca.SX:
    """Return whether a fixed tangent and the nearest one have nearly the same direction."""
    apart, length = (ca.sumsqr(slope @ end.by_X) for slope in (fixed.slope - nearest.slope, fixed.slope))
    return apart < TANGENT_TOLERANCE**2 * length


def _has_tangents(point: RoundPoint) -> bool:
    return point.wall.kind == "plane" or bool(point.axis.any())


def _tangent_terms(point: RoundPoint, end: _End, body_height: ca.SX, wall_height: ca.SX) -> Terms:
    """Return the terms of a point beside a plane, or of a shaft in a hollow cylinder; the heights are their growth [mm].

    The gap is written for a tangent plane with normal e, turned by `delta` towards t. A plane is its own tangent plane. Of a
    hollow wall the nearest one counts: e* with d gap / d delta = 0. As the shaft's end s moves, e* turns, which lowers the
    second derivative by (d2 gap / ds d delta)^2 / (d2 gap / d delta2), unless e* stops where the wall ends.
    """
    c, a, s = end.centre, end.axis, end.symbols
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
    slope, slide = ca.jacobian(gap, s), ca.jacobian(gap, delta)
    bend, sliding, stiffness = ca.hessian(gap, s)[0], ca.jacobian(slide, s), ca.jacobian(slide, delta)
    symbols = [e, t, delta]
    if point.wall.kind == "plane":
        flat = _put([gap, slope, bend], symbols, [ca.SX(-ca.DM(w)), ca.SX.zeros(3), ca.SX(0)])
        return Terms(flat[0], flat[1], flat[2], ca.SX(*bend.shape))
    turning = ca.Function("turning", [s, both_heights, e, t], _put([slide, stiffness], [delta], [ca.SX(0)]))
    nearest, is_free = _nearest_tangent(point, turning, s, both_heights, c - o)
    min_stiffness = ca.fmax(ca.fabs(float(point.wall.radius) - r - wall_height - body_height), MIN_FREEDOM * r)
    closing = is_free * sliding.T @ sliding / ca.fmax(stiffness, min_stiffness)
    return Terms(*_put([gap, slope, bend, closing], symbols, [nearest, ca.cross(ca.DM(w), nearest), ca.SX(0)]))


def _put(expressions: list[ca.SX], symbols: list[ca.SX], values: list[ca.SX]) -> list[ca.SX]:
    """Return expressions with values in place of symbols."""
    return list(ca.substitute(expressions, symbols, values))  # type: ignore[arg-type]


def _nearest_tangent(point: RoundPoint, turning: ca.Function, s: ca.SX, grown: ca.SX, q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the outward unit vector (3, 1) of the wall's nearest tangent plane, and 0 if the wall ends there, else 1.

    turning  Function of the shaft's end s, growth of shaft and wall, e and t: the gap's derivatives as e turns towards t
    q        (3, 1) from the wall's axis to the shaft's
    """
    w, x = ca.DM(point.wall.axis), ca.DM(point.towards)
    _, e = _direction(_across(w, q) + AXIS_OFFSET * x)
    _, e = _direction(_across(w, e))  # what rounding left along the axis counts if a shaft is hardly off it
    e, is_free = _within(point, e)
    min_stiffness = MIN_FREEDOM * float(point.radius) * 1e-3
    for _ in range(NEWTON_STEPS):
        t = ca.cross(w, e)
        slope_along, stiffness = turning(s, grown, e, t)
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


def _ball_terms(point: RoundPoint, end: _End, body_height: ca.SX, wall_height: ca.SX) -> Terms:
    """Return the terms of a ball beside a curved wall."""
    side = -1.0 if point.is_hollow else 1.0
    distance, normal, around, fixed_part = _distance(point, end.centre, body_height + wall_height)
    bend, closing = (fixed_part, around) if point.is_hollow else (around + fixed_part, ca.SX(3, 3))
    gap = side * distance - float(point.radius) - body_height - wall_height
    return Terms(gap, side * normal.T, bend, closing)


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
