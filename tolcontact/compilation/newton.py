"""Curvature: what Newton steps of the exact resolution know beyond the linear step of the paper."""

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
    """Q and its linear term, where `newton` is 1 with the curvature of objective and gaps at `poses`, of second order in z.

    Curvature counts only while Q stays convex. Rows that carry are held in the objective, too: it does not change the
    answer, and makes it convex again, or nearly: what is checked are the freedoms of each mover, not those of several together.
    """
    reactions = inputs["reactions"]
    curvature = _of_lagrangian(setting, poses, rows.bends / goal.scale) + (rows.wrap - rows.bow) / goal.scale - Q
    hold = (1 + 2 * ca.sum1(reactions) / goal.scale / setting.group.length) * ca.if_else(reactions > 0, rows.filled, 0)
    curvature += rows.slopes.T @ ca.diag(hold) @ rows.slopes
    counts = ca.logic_and(inputs["newton"], _is_convex(Q + curvature))
    return Q + ca.if_else(counts, curvature, 0), pull + ca.if_else(counts, rows.slopes.T @ (hold * rows.gaps), 0)


def _of_lagrangian(setting: Setting, poses: Sequence[Pose], bends: ca.SX) -> ca.SX:
    """Hessian of the Lagrangian at z = 0: of the objective less the reactions' work on the gaps (linear in X_RM)."""
    work = ca.dot(bends, ca.vertcat(*(X_RM.vector() for X_RM in setting.relative(poses))))
    return setting.curvature(energy(setting, poses).value - work)


def _is_convex(Q: ca.SX) -> ca.SX:
    """Whether the diagonal blocks of Q are positive definite; a NaN among the pivots is not."""
    blocks = (ca.densify(Q[k : k + FREEDOMS, k : k + FREEDOMS]) for k in range(0, Q.size1(), FREEDOMS))
    pivots = ca.vertcat(*(ca.diag(ca.chol(block)) for block in blocks))
    return ca.mmin(ca.if_else(pivots > 0, 1, 0))
