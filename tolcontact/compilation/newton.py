"""Curvature of objective and gaps, for Newton steps of the exact resolution."""

from collections.abc import Mapping, Sequence

import casadi as ca

from tolcontact.compilation.contact_rows import Rows
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.objective import Energy, energy
from tolcontact.mechanics.pose import Pose
from tolcontact.mechanics.setting import Setting


def with_curvature(
    setting: Setting, goal: Energy, rows: Rows, poses: Sequence[Pose], Q: ca.SX, pull: ca.SX, inputs: Mapping[str, ca.SX]
) -> tuple[ca.SX, ca.SX]:
    """Return Q and its linear term, if `newton` is 1 with the curvature of objective and gaps at `poses`, to second order in z.

    Curvature counts only while Q stays convex. A penalty holds the rows that carry. It does not change the answer, and restores
    convexity in most cases. The check covers the freedoms of each mover, not those of several movers together.
    """
    reactions = inputs["reactions"]
    curvature = _lagrangian_hessian(setting, poses, rows.bends / goal.scale) + (rows.wrap - rows.bow) / goal.scale - Q
    hold = (1 + 2 * ca.sum1(reactions) / goal.scale / setting.group.length) * ca.if_else(reactions > 0, rows.filled, 0)
    curvature += rows.slopes.T @ ca.diag(hold) @ rows.slopes
    counts = ca.logic_and(inputs["newton"], is_convex(Q + curvature))
    return Q + ca.if_else(counts, curvature, 0), pull + ca.if_else(counts, rows.slopes.T @ (hold * rows.gaps), 0)


def _lagrangian_hessian(setting: Setting, poses: Sequence[Pose], bends: ca.SX) -> ca.SX:
    """Return the Hessian, at z = 0, of the Lagrangian: the objective less the reactions' work on the gaps (linear in X_RM)."""
    work = ca.dot(bends, ca.vertcat(*(X_RM.vector() for X_RM in setting.relative(poses))))
    return setting.curvature(energy(setting, poses).value - work)


def is_convex(Q: ca.SX) -> ca.SX:
    """Return 1 if the diagonal blocks of Q are positive definite, else 0, also for a NaN among the pivots."""
    blocks = (ca.densify(Q[k : k + FREEDOMS, k : k + FREEDOMS]) for k in range(0, Q.size1(), FREEDOMS))
    pivots = ca.vertcat(*(ca.diag(ca.chol(block)) for block in blocks))
    return ca.mmin(ca.if_else(pivots > 0, 1, 0))
