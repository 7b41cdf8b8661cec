"""Gaps of contact points, paper (2) to (5): the expression, and all gaps of a pair as affine functions of few coordinates.

In the frame of the reference part the gap is affine in the relative pose X_RM, so all gaps of a pair are one product of 13
numbers (the entries of the pose, and 1) with a constant matrix G, the Jacobian of the expression. Where both faces are planes,
gaps are affine in two coordinates of the points: G = basis @ coordinates, with three rows of coordinates instead of thirteen.
An affine function has its minimum at a corner of the points' convex hull, so that only hull corners can be the deepest point,
at any pose.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from tolcontact.discretization import ContactPoints, Offsets
from tolcontact.mechanics.pose import ENTRIES, Pose, pose_of

Point = tuple[ca.SX, ca.SX, ca.SX, ca.SX]  # P^m, P^r, n^r, and 1 if it has a row


class RowPoints(NamedTuple):
    """The points of a pair that have rows.

    points       none if they follow from every pose
    compliance   (row, 1) [mm/N]: of compliant points; 0 for rigid ones
    bend         (12, 1): of the points in the slots of the previous step; None for points that always have a row, since their
                 previous reactions are available
    """

    points: Sequence[Point]
    compliance: ca.SX
    bend: ca.SX | None = None


class GapTerms(NamedTuple):
    """The gaps of a pair's points at X_RM, and their derivatives by the increments z.

    gaps              (point, 1) [mm]; where two tangents of a hollow wall nearly agree, both have the gap of the nearer one
    slopes            (point, z): derivatives of the gaps by z
    bends             (12, 1): sum of reaction times gap derivative by X_RM
    curvature         (z, z): sum of reaction times second gap derivative, for X_RM linear in z, without `hollow_curvature`
    hollow_curvature  (z, z): the part of that sum due to bodies sliding along hollow walls; positive semidefinite, and to be
                      subtracted from `curvature`
    distances         (point, 1) [mm]: the gap of each point, without regard to other tangents
    """

    gaps: ca.SX
    slopes: ca.SX
    bends: ca.SX
    curvature: ca.SX
    hollow_curvature: ca.SX
    distances: ca.SX


def gap(X_RM: Pose, P_m: ca.SX, P_r: ca.SX, n_r: ca.SX) -> ca.SX:
    """Return the signed gap [mm] of paper (5), negative if the moving point lies inside the reference part.

    In the reference frame the normal n = R_r n^r of (4) is n^r. R_r must be a rotation.
    """
    return ca.dot(n_r, X_RM.apply(P_m) - P_r)


def gap_gradient() -> ca.Function:
    """Return the Function (P_m, P_r, n_r) -> (gradient of the gap by the 12 entries of X_RM, gap at X_RM = 0) of one point."""
    X_RM, P_m, P_r, n_r = ca.SX.sym("X_RM", ENTRIES), ca.SX.sym("P_m", 3), ca.SX.sym("P_r", 3), ca.SX.sym("n_r", 3)
    g = gap(pose_of(X_RM), P_m, P_r, n_r)
    constant = ca.substitute(g, X_RM, ca.SX.zeros(ENTRIES))
    return ca.Function("gap_gradient", [P_m, P_r, n_r], [ca.jacobian(g, X_RM).T, constant])


def gap_matrix(pair: ContactPoints) -> np.ndarray:
    """Return the constant matrix (13, point): gaps (point,) [mm] = [entries of X_RM, 1] @ matrix."""
    gradient, constant = gap_gradient().map(len(pair.P_m))(pair.P_m.T, pair.P_r.T, pair.n_r.T)
    return np.vstack([gradient.full(), constant.full()])


FLATNESS = 1e-13  # of the largest entry: normals of flat faces differ by up to this


@dataclass(frozen=True, eq=False)
class GapMap:
    """All gaps of a pair: [[X_RM, 1] @ basis, deviations[columns]] @ coordinates [mm].

    basis         (13, r)
    columns       (k,) of the deviations that raise points above their faces
    coordinates   (r + k, point): the first row is 1, the last k rows are the derivatives of the gaps by these deviations
    corners       indices of the points that can be the deepest: corners of the hull in up to two coordinates, else all points
    """

    basis: np.ndarray
    columns: np.ndarray
    coordinates: np.ndarray
    corners: np.ndarray


def gap_map(G: np.ndarray, offsets: Offsets) -> GapMap:
    """Factor the matrix G (13, point), up to rounding."""
    centre = G.mean(axis=1)
    U, S, V = np.linalg.svd(G - centre[:, None], full_matrices=False)
    tolerance = FLATNESS * np.abs(G).max()
    rank = 0
    while rank < len(S) and np.abs(U[:, rank:] * S[rank:] @ V[rank:]).max() > tolerance:
        rank += 1
    basis = np.column_stack([centre, U[:, :rank]])
    coordinates = np.vstack([np.ones(G.shape[1]), S[:rank, None] * V[:rank], -offsets.matrix])
    return GapMap(basis, offsets.columns, coordinates, hull_corners(coordinates[1:]))


def hull_corners(coordinates: np.ndarray) -> np.ndarray:
    """Return the corners of the convex hull of points (coordinate, point), in order; all points beyond two coordinates.

    Coordinates that are equal for all points are left out.
    """
    coordinates = coordinates[[np.ptp(row) > 0 for row in coordinates]] if len(coordinates) else coordinates
    if len(coordinates) == 0:
        return np.array([0])
    if len(coordinates) == 1:
        return np.unique([coordinates[0].argmin(), coordinates[0].argmax()])
    if len(coordinates) == 2 and coordinates.shape[1] > 3:
        try:
            return np.sort(ConvexHull(coordinates.T).vertices)
        except QhullError:  # the points lie almost on one line
            pass
    return np.arange(coordinates.shape[1])


class FixedGaps:
    """Gaps of fixed points over fixed tangent planes, paper (5): affine in X_RM.

    key   what distinguishes the equations of one pair from another's, except for their inputs
    """

    def __init__(self, pair: ContactPoints) -> None:
        self._pair = pair
        self.key: tuple[bytes, ...] = ()

    def compiled(self, inputs: int) -> GapMap | ca.Function:
        """Return all gaps at X_RM, for a number of `inputs` of a realization."""
        return gap_map(gap_matrix(self._pair), self._pair.offsets)

    def points(self, chosen: np.ndarray, deviations: ca.SX) -> list[Point]:
        """Return points that always have a row: constants, except for the offsets that depend on deviations."""
        pair = self._pair
        P_m, P_r, n_r = (ca.SX(ca.DM(values[chosen].T)) for values in (pair.P_m, pair.P_r, pair.n_r))
        offsets = pair.offsets.take(chosen)
        if offsets.columns.size:
            heights = ca.sparsify(ca.DM(offsets.matrix.T)) @ deviations[offsets.columns.tolist()]
            P_r = P_r + n_r @ ca.diag(heights)
        return list(zip(*(ca.horzsplit(values) for values in (P_m, P_r, n_r, ca.SX.ones(1, len(chosen)))), strict=True))

    def values(self, X_RM: Pose, heights: ca.SX, points: RowPoints) -> Sequence[ca.SX]:
        """Return the gaps of the rows at a pose, for the growth (2, 1) [mm] of both faces."""
        return [gap(X_RM, P_m, P_r, n_r) for P_m, P_r, n_r, _ in points.points]

    def rows(self, X_RM: Pose, by_z: ca.SX, heights: ca.SX, points: RowPoints, reactions: ca.SX) -> GapTerms:
        """Return the gaps of the rows about X_RM, whose derivatives by the increments are `by_z` (12, z), see contact_rows."""
        slopes, gaps = [], []
        bends = ca.SX.zeros(ENTRIES) if points.bend is None else points.bend
        for row, (P_m, P_r, n_r, _) in enumerate(points.points):
            X = ca.SX.sym("X_RM", ENTRIES)
            g = gap(pose_of(X), P_m, P_r, n_r)
            gradient = ca.substitute(ca.jacobian(g, X), X, X_RM.vector())
            if points.bend is None:
                bends += gradient.T * reactions[row]
            slopes.append(gradient @ by_z)
            gaps.append(ca.substitute(g, X, X_RM.vector()))
        flat, all_gaps = ca.SX(by_z.size2(), by_z.size2()), ca.vertcat(ca.SX(0, 1), *gaps)
        return GapTerms(all_gaps, ca.vertcat(ca.SX(0, by_z.size2()), *slopes), bends, flat, flat, all_gaps)
