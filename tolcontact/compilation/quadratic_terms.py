"""The objective of a contact QP to second order in the increments, and what Newton steps add to it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from tolcontact.compilation.contact_rows import Rows
from tolcontact.mechanics.correction import FREEDOMS, Motion, linear, quadratic
from tolcontact.mechanics.objective import energy, proximity
from tolcontact.mechanics.pose import Pose
from tolcontact.mechanics.setting import Setting
from tolcontact.mechanics.symmetric_products import congruent


@dataclass(frozen=True, eq=False)
class QuadraticTerms:
    """The objective 1/2 z'Qz + pull'z at a pose, divided by `scale`, see tolcontact.mechanics.objective.

    Q, pull     (z, z), (z, 1), in an exact resolution with the curvature of walls around round faces
    curvature   (z, z): to be added to Q if a Newton step counts the curvature of objective and gaps, and Q stays convex
    hold        (z, 1): to be added to `pull` with it
    nearness    (z, z): to be added to Q where points are projected in each step, times `caution`
    """

    Q: ca.SX
    pull: ca.SX
    curvature: ca.SX
    hold: ca.SX
    nearness: ca.SX
    scale: ca.SX

    def summed(self, newton: ca.SX, caution: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return Q and its linear term, if `newton` is 1 with the curvature.

        Curvature counts only while Q stays convex. The check covers the freedoms of each mover, not those of several movers
        together.
        """
        counts = ca.logic_and(newton, is_convex(self.Q + self.curvature))
        Q = self.Q + ca.if_else(counts, self.curvature, 0) + caution * self.nearness
        return Q, self.pull + ca.if_else(counts, self.hold, 0)


def quadratic_terms(
    setting: Setting, rows: Rows, motion: Motion, reactions: ca.SX, load: ca.SX, *, projects: bool
) -> QuadraticTerms:
    """Return the terms at the poses of `motion`.

    reactions   (row, 1) of the points in the previous step, and their sum `load` over all rows of the group
    projects    whether points may be projected in each step
    """
    size = setting.z.numel()
    if setting.group.has_springs:  # what holds weakly must not share the load with springs: it counts from the present poses
        setting = replace(setting, raw=motion.poses)
    moved, nothing = motion.by(linear), ca.SX(size, size)
    goal = energy(setting, moved)
    Q, pull = (setting.at_rest(expression) for expression in ca.hessian(goal.value, setting.z))
    if not setting.method.is_exact:
        return QuadraticTerms(Q, pull, nothing, ca.SX(size, 1), nothing, goal.scale)
    Q += rows.wrap / goal.scale
    curvature = _lagrangian_hessian(setting, motion.by(quadratic), rows.bends / goal.scale)
    curvature += (rows.wrap - rows.bow) / goal.scale - Q
    # A penalty holds the rows that carry. It does not change the answer, and restores convexity in most cases.
    hold = (1 + 2 * load / goal.scale / setting.group.length) * ca.if_else(reactions > 0, rows.filled, 0)
    curvature += congruent(ca.diag(hold), rows.slopes)
    give = rows.gaps + rows.compliance * reactions
    nearness = setting.curvature(proximity(setting, motion.poses, moved)) / setting.group.length if projects else nothing
    return QuadraticTerms(Q, pull, curvature, rows.slopes.T @ (hold * give), nearness, goal.scale)


def _lagrangian_hessian(setting: Setting, poses: Sequence[Pose], bends: ca.SX) -> ca.SX:
    """Return the Hessian, at z = 0, of the Lagrangian: the objective less the reactions' work on the gaps (linear in X_RM)."""
    weights = ca.SX.sym("bends", bends.numel())  # do not depend on z: as symbols they are left alone by the derivatives
    work = ca.dot(weights, ca.vertcat(*(X_RM.vector() for X_RM in setting.relative(poses))))
    return ca.substitute(setting.curvature(energy(setting, poses).value - work), weights, bends)


def is_convex(Q: ca.SX) -> ca.SX:
    """Return 1 if the diagonal blocks of Q are positive definite, else 0, also for a NaN among the pivots."""
    blocks = (ca.densify(Q[k : k + FREEDOMS, k : k + FREEDOMS]) for k in range(0, Q.size1(), FREEDOMS))
    pivots = ca.vertcat(*(ca.diag(ca.chol(block)) for block in blocks))
    return ca.mmin(ca.if_else(pivots > 0, 1, 0))
