"""The gaps of each kind of contact as equations: rows of the QP to first order, and all gaps at once as arrays take them.

A kind of contact is a class of points (see discretization) with a class of gaps here, which `KINDS` names.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from tolcontact.discretization import ContactPoints, RoundContact
from tolcontact.mechanics.gap import GapMap, gap, gap_map, gap_matrix
from tolcontact.mechanics.group_equations import face_heights
from tolcontact.mechanics.pose import ENTRIES, Pose, pose_of
from tolcontact.mechanics.round_gap import RoundGaps, round_gaps

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


class PairRows(NamedTuple):
    """The rows of a pair about a pose X_RM: slopes (row, z), gaps (row, 1) [mm] and filled (row, 1), see Rows.

    bends                         (12, 1), see Rows
    curvature, hollow_curvature   (z, z), see RoundGaps; empty for gaps that are affine in X_RM
    """

    slopes: ca.SX
    gaps: ca.SX
    filled: ca.SX
    bends: ca.SX
    curvature: ca.SX
    hollow_curvature: ca.SX


class FixedGaps:
    """Gaps of fixed points over fixed tangent planes, paper (5): affine in X_RM.

    key   what distinguishes the equations of one pair from another's, except for their inputs
    """

    def __init__(self, pair: ContactPoints) -> None:
        self._pair = pair
        self.key: tuple[bytes, ...] = ()

    @property
    def affine(self) -> GapMap | None:
        """All gaps as affine functions; None if they are not."""
        return gap_map(gap_matrix(self._pair), self._pair.offsets)

    def function(self, inputs: int) -> ca.Function | None:
        """Return the Function of all gaps, for a number of `inputs` of a realization; None if they are affine."""
        return None

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

    def rows(self, X_RM: Pose, by_z: ca.SX, heights: ca.SX, points: RowPoints, reactions: ca.SX) -> PairRows:
        """Return the rows about X_RM, whose derivatives by the increments are `by_z` (12, z), see contact_rows."""
        slopes, gaps, flat = [], [], ca.SX(by_z.size2(), by_z.size2())
        bends = ca.SX.zeros(ENTRIES) if points.bend is None else points.bend
        for row, (P_m, P_r, n_r, _) in enumerate(points.points):
            X = ca.SX.sym("X_RM", ENTRIES)
            g = gap(pose_of(X), P_m, P_r, n_r)
            gradient = ca.substitute(ca.jacobian(g, X), X, X_RM.vector())
            if points.bend is None:
                bends += gradient.T * reactions[row]
            slopes.append(gradient @ by_z)
            gaps.append(ca.substitute(g, X, X_RM.vector()))
        filled = [is_filled for *_, is_filled in points.points]
        all_gaps, all_filled = (ca.vertcat(ca.SX(0, 1), *values) for values in (gaps, filled))
        return PairRows(ca.vertcat(ca.SX(0, by_z.size2()), *slopes), all_gaps, all_filled, bends, flat, flat)


class CurvedGaps(FixedGaps):
    """Gaps of balls and shafts against walls, at points that follow from every pose (see round_gap)."""

    def __init__(self, pair: RoundContact) -> None:
        self._pair, self._round = pair, pair.round
        self.key = pair.round.fingerprint

    @property
    def affine(self) -> GapMap | None:
        return None

    def function(self, inputs: int) -> ca.Function | None:
        """Return the Function X_RM, deviations -> gaps and distances (point, 1) [mm], see RoundGaps."""
        X_RM, deviations = ca.SX.sym("X_RM", ENTRIES), ca.SX.sym("deviations", inputs)
        results = self._at(X_RM, face_heights(self._pair, deviations))
        outputs = {"gaps": results.gaps, "distances": results.distances}
        return ca.Function("round_gaps", [X_RM, deviations], [*outputs.values()], ["X_RM", "deviations"], [*outputs])

    def points(self, chosen: np.ndarray, deviations: ca.SX) -> list[Point]:
        return []

    def values(self, X_RM: Pose, heights: ca.SX, points: RowPoints) -> Sequence[ca.SX]:
        return ca.vertsplit(self._at(X_RM.vector(), heights).gaps)

    def rows(self, X_RM: Pose, by_z: ca.SX, heights: ca.SX, points: RowPoints, reactions: ca.SX) -> PairRows:
        z, count = sorted(set(by_z.sparsity().get_triplet()[1])), by_z.size2()  # increments of the two parts of the pair
        found = round_gaps(self._round, X_RM.vector(), heights, reactions, by_z[:, z])
        slopes, curvature, hollow_curvature = (ca.SX(rows, count) for rows in (len(self._round), count, count))
        slopes[:, z], curvature[z, z], hollow_curvature[z, z] = found.slopes, found.curvature, found.hollow_curvature
        filled = ca.SX.ones(len(self._round))
        return PairRows(slopes, found.gaps, filled, found.bends, curvature, hollow_curvature)

    def _at(self, X_RM: ca.SX, heights: ca.SX) -> RoundGaps:
        return round_gaps(self._round, X_RM, heights, ca.SX(len(self._round), 1), ca.SX(ENTRIES, 0))


KINDS: dict[type[ContactPoints], Callable[[Any], FixedGaps]] = {ContactPoints: FixedGaps, RoundContact: CurvedGaps}


def pair_gaps(pair: ContactPoints) -> FixedGaps:
    """Return the equations of a pair's kind of contact."""
    return KINDS[type(pair)](pair)
