"""The gaps of each kind of contact as equations: rows of the QP to first order, and all gaps at once as arrays take them.

A kind of contact is a class of points (see discretization) with a class of gaps here, which `KINDS` names.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from tolcontact.discretization import ContactPoints, RoundContact
from tolcontact.mechanics.gap import GapMap, GapTerms, gap, gap_map, gap_matrix
from tolcontact.mechanics.group_equations import face_heights
from tolcontact.mechanics.pose import ENTRIES, Pose, pose_of
from tolcontact.mechanics.round_gap import round_gaps

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


class CurvedGaps(FixedGaps):
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


KINDS: dict[type[ContactPoints], Callable[[Any], FixedGaps]] = {ContactPoints: FixedGaps, RoundContact: CurvedGaps}


def pair_gaps(pair: ContactPoints) -> FixedGaps:
    """Return the equations of a pair's kind of contact."""
    return KINDS[type(pair)](pair)
