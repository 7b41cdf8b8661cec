"""Gaps of round faces at any pose: of the centre of a ball, or the axis ends of a shaft, against a wall."""

import functools
from collections.abc import Sequence

import casadi as ca
import numpy as np

from tolcontact.discretization import RoundContact, RoundPoint, RoundPoints
from tolcontact.mechanics.gap import FixedGaps, GapMap, GapTerms, Point, RowPoints
from tolcontact.mechanics.group_equations import face_heights
from tolcontact.mechanics.pose import ENTRIES, Pose, congruent, pose_of
from tolcontact.mechanics.round_terms import Terms, round_terms

TOLERANCE = 1e-9
ROUNDING = 1e-14  # of the distance from the origin: error of a point that is computed on an axis
TANGENT_TOLERANCE = 0.05  # rad: tangents within this angle count as one


def round_gaps(points: RoundPoints, X_RM: ca.SX, growths: ca.SX, reactions: ca.SX, by_z: ca.SX) -> GapTerms:
    """Return the gaps of round points.

    X_RM       (12, 1)
    growths    (2, 1) [mm]: growth of the moving and the reference face
    reactions  (point, 1)
    by_z       (12, z): the derivatives of X_RM by z
    """
    bodies: list[_Body] = []
    gaps, slopes, distances = [], [], []
    loads, terms_of_points = ca.vertsplit(reactions), []
    nearest: int | None = None  # index of the last tangent that rotates along a hollow wall
    entries = list(points)
    for k, point in enumerate(entries):
        body = next((body for body in bodies if body.has(point)), None)
        if body is None:
            bodies.append(body := _Body(point, X_RM, by_z))
        growths_of_point = growths if point.on_moving else growths[[1, 0]]
        terms = round_terms(point, body.coordinates, body.station(point), growths_of_point)
        terms_of_points.append((body, terms))
        gap, slope = terms.gap, terms.slope
        distances.append(gap)
        if point.is_hollow:
            nearest = k
        elif nearest is not None and _is_at(point, entries[nearest]) and _touches(point, entries[nearest]):
            # Otherwise either could be active, to a solver's accuracy, and the steps would not converge.
            nearer = terms_of_points[nearest][1]
            gap, slope, passed_load, kept_load = body.merged.call([
                gap, slope, nearer.gap, nearer.slope, body.squares, loads[k]
            ])  # fmt: skip
            loads[nearest], loads[k] = loads[nearest] + passed_load, kept_load
        gaps.append(gap)
        slopes.append(slope @ body.by_z)
    if reactions.nnz():
        for (body, terms), load in zip(terms_of_points, loads, strict=True):
            body.add(terms, load)
    freedoms = by_z.size2()
    return GapTerms(
        gaps=ca.vertcat(*gaps),
        slopes=ca.vertcat(*slopes),
        bends=sum((body.bends() for body in bodies), ca.SX(ENTRIES, 1)),
        curvature=sum((body.curvature() for body in bodies), ca.SX(freedoms, freedoms)),
        hollow_curvature=sum((body.hollow_curvature for body in bodies), ca.SX(freedoms, freedoms)),
        distances=ca.vertcat(*distances),
    )


class RoundGaps(FixedGaps):
    """Gaps of balls and shafts against walls, at points that follow from every pose (see round_gap)."""

    def __init__(self, pair: RoundContact) -> None:
        self._pair, self._round = pair, pair.round
        self.key = pair.round.fingerprint

    def compiled(self, inputs: int) -> GapMap | ca.Function:
        """Return the Function X_RM, deviations -> gaps and distances (point, 1) [mm], see GapTerms."""
        X_RM, deviations = ca.SX.sym("X_RM", ENTRIES), ca.SX.sym("deviations", inputs)
        terms = self._at(X_RM, face_heights(self._pair, deviations))
        outputs = {"gaps": terms.gaps, "distances": terms.distances}
        return ca.Function("round_gaps", [X_RM, deviations], [*outputs.values()], ["X_RM", "deviations"], [*outputs])

    def points(self, chosen: np.ndarray, deviations: ca.SX) -> list[Point]:
        return []

    def values(self, X_RM: Pose, heights: ca.SX, points: RowPoints) -> Sequence[ca.SX]:
        return ca.vertsplit(self._at(X_RM.vector(), heights).gaps)

    def rows(self, X_RM: Pose, by_z: ca.SX, heights: ca.SX, points: RowPoints, reactions: ca.SX) -> GapTerms:
        z, count = sorted(set(by_z.sparsity().get_triplet()[1])), by_z.size2()  # increments of the two parts of the pair
        terms = round_gaps(self._round, X_RM.vector(), heights, reactions, by_z[:, z])
        slopes, curvature, hollow_curvature = (ca.SX(rows, count) for rows in (len(self._round), count, count))
        slopes[:, z], curvature[z, z], hollow_curvature[z, z] = terms.slopes, terms.curvature, terms.hollow_curvature
        return terms._replace(slopes=slopes, curvature=curvature, hollow_curvature=hollow_curvature)

    def _at(self, X_RM: ca.SX, heights: ca.SX) -> GapTerms:
        return round_gaps(self._round, X_RM, heights, ca.SX(len(self._round), 1), ca.SX(ENTRIES, 0))


class _Body:
    """A ball or a shaft in the frame of the part that has the wall.

    coordinates       (n, 1): its centre, or a point of its axis and the axis
    by_X, by_z        (n, 12), (n, z): the derivatives of `coordinates`
    squares           (n / 3, n / 3): by_X by_X' consists of 3 x 3 blocks, which are these numbers times the identity
    merged            see _merged
    hollow_curvature  (z, z): the part of the second derivative by z of the sum of load times gap that closing walls subtract
    """

    def __init__(self, point: RoundPoint, X_RM: ca.SX, by_z: ca.SX) -> None:
        self._point, self._X, self._X_by_z = point, X_RM, by_z
        self._function = _coordinates(bool(point.on_moving), bool(point.axis.any()))
        self.coordinates, self.by_X, _ = self._evaluated(ca.SX(self._function.size1_in("weights"), 1))
        self.by_z = self.by_X @ by_z
        rows = self.by_X[::3, :]
        self.squares, self.merged = rows @ rows.T, _merged(rows.size1())
        size, freedoms = self.coordinates.numel(), by_z.size2()
        self._slope, self._bend, self.hollow_curvature = ca.SX(1, size), ca.SX(size, size), ca.SX(freedoms, freedoms)

    def _evaluated(self, weights: ca.SX) -> Sequence[ca.SX]:
        """Return the coordinates, their derivatives and weighted second derivative (see _coordinates) for weights (n, 1)."""
        return self._function.call([self._X, ca.SX(ca.DM(self._point.centre)), ca.SX(ca.DM(self._point.axis)), weights])

    def has(self, point: RoundPoint) -> bool:
        """Return whether a point belongs to this ball or shaft."""
        origin = self._point
        if point.on_moving != origin.on_moving or (point.axis != origin.axis).any():
            return False
        off_axis = point.centre - origin.centre - self.station(point) * point.axis
        size = np.linalg.norm(point.centre) + np.linalg.norm(origin.centre)
        return bool(np.linalg.norm(off_axis) <= ROUNDING * size)

    def station(self, point: RoundPoint) -> float:
        """Return the coordinate [mm] of a point along the axis of a shaft, from its first point."""
        return float((point.centre - self._point.centre) @ point.axis)

    def add(self, terms: Terms, load: ca.SX) -> None:
        """Add the terms of a point under a load."""
        self._slope += load * terms.slope
        self._bend += load * terms.bend
        sliding = terms.sliding @ self.by_z
        self.hollow_curvature += congruent(load * terms.closing * ca.SX.eye(sliding.size1()), sliding)

    def bends(self) -> ca.SX:
        """Return the derivative (12, 1) by X_RM of the sum of load times gap."""
        return self.by_X.T @ self._slope.T

    def curvature(self) -> ca.SX:
        """Return the second derivative (z, z) of the sum of load times gap, without closing walls."""
        *_, coordinate_curvature = self._evaluated(self._slope.T)
        one_sided = self._X_by_z.T @ ca.triu(coordinate_curvature) @ self._X_by_z  # each entry of X_RM enters linearly
        return one_sided + one_sided.T + congruent(self._bend, self.by_z)


@functools.cache
def _coordinates(on_moving: bool, has_axis: bool) -> ca.Function:
    """Return a Function of X_RM (12), the nominal centre (3) and axis (3) of a ball or shaft, and weights (n).

    Its results are the coordinates (n) and by_X (n, 12) of _Body, and coordinate_curvature (12, 12), the second derivative by
    X_RM of weights'coordinates.
    """
    X, centre, axis = ca.SX.sym("X_RM", ENTRIES), ca.SX.sym("centre", 3), ca.SX.sym("axis", 3)
    pose = pose_of(X)
    if not on_moving:
        pose = Pose(pose.R.T, -(pose.R.T @ pose.t))
    coordinates = pose.apply(centre)
    if has_axis:
        coordinates = ca.vertcat(coordinates, pose.R @ axis)
    weights = ca.SX.sym("weights", coordinates.numel())
    coordinate_curvature, _ = ca.hessian(ca.dot(weights, coordinates), X)
    inputs = {"X_RM": X, "centre": centre, "axis": axis, "weights": weights}
    outputs = {"coordinates": coordinates, "by_X": ca.jacobian(coordinates, X), "coordinate_curvature": coordinate_curvature}
    return ca.Function("coordinates", [*inputs.values()], [*outputs.values()], [*inputs], [*outputs])


def _is_at(point: RoundPoint, other: RoundPoint) -> bool:
    """Return whether two points belong to the same ball, or the same end of a shaft."""
    is_same = (point.centre == other.centre).all() and (point.axis == other.axis).all()
    return bool(is_same and point.on_moving == other.on_moving)


def _touches(plane: RoundPoint, hollow: RoundPoint) -> bool:
    """Return whether a plane is a fixed tangent of a hollow wall."""
    wall, n = hollow.wall, plane.wall.axis
    if plane.wall.kind != "plane":
        return False
    offset = float(n @ (plane.wall.origin - wall.origin)) + wall.radius  # n points inward
    tilt = 0.0 if wall.kind == "sphere" else float(n @ wall.axis) - np.sin(wall.angle)
    return abs(offset) < TOLERANCE * plane.radius and abs(tilt) < TOLERANCE


@functools.cache
def _merged(vectors: int) -> ca.Function:
    """Return a Function of the gaps and slopes of a fixed and the nearest tangent, and the load of the fixed tangent.

    Its results are the gap and slope of the fixed tangent, the load that it passes to the nearest tangent, and the load that it
    keeps. If both tangents have nearly the same direction, the fixed one takes gap and slope of the nearest one, and passes its
    load. The coordinates consist of one or two `vectors`: the centre and the axis. `squares` (vector, vector) are the products
    of their derivatives by X_RM (see _Body).
    """
    gap, nearest_gap, load = (ca.SX.sym(name) for name in ("gap", "nearest_gap", "load"))
    slope, nearest_slope = (ca.SX.sym(name, 1, 3 * vectors) for name in ("slope", "nearest_slope"))
    squares = ca.SX.sym("squares", vectors, vectors)

    def square(by_coordinates: ca.SX) -> ca.SX:
        by_vector = ca.reshape(by_coordinates, 3, vectors)
        return ca.dot(squares, by_vector.T @ by_vector)

    is_parallel = square(slope - nearest_slope) < TANGENT_TOLERANCE**2 * square(slope)
    results = [
        ca.if_else(is_parallel, nearest_gap, gap),
        ca.if_else(is_parallel, nearest_slope, slope),
        ca.if_else(is_parallel, load, 0),
        ca.if_else(is_parallel, 0, load),
    ]
    return ca.Function("merged", [gap, slope, nearest_gap, nearest_slope, squares, load], results)
