"""The objective of a contact QP to second order in the increments, and the additional terms of Newton steps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from tolcontact.compilation.calls import Call
from tolcontact.compilation.contact_rows import Rows
from tolcontact.mechanics.correction import FREEDOMS, Motion, linear, quadratic
from tolcontact.mechanics.group_equations import GroupEquations
from tolcontact.mechanics.objective import energy, proximity
from tolcontact.mechanics.pose import Pose, congruent


@dataclass(frozen=True, eq=False)
class QuadraticTerms:
    """The objective 1/2 z'Qz + gradient'z at a pose, divided by `scale`, see tolcontact.mechanics.objective.

    Q, gradient          (z, z), (z, 1), in an exact resolution with the curvature of walls around round faces
    curvature            (z, z): added to Q if a Newton step counts the curvature of objective and gaps, and Q stays convex
    augmented_gradient   (z, 1): added to `gradient` together with `curvature`; from the augmented Lagrangian
    proximal_hessian     (z, z): added to Q, times `proximal_weight`, if points are projected in each step
    """

    Q: ca.SX
    gradient: ca.SX
    curvature: ca.SX
    augmented_gradient: ca.SX
    proximal_hessian: ca.SX
    scale: ca.SX

    def summed(self, newton: ca.SX, proximal_weight: ca.SX, call: Call) -> tuple[ca.SX, ca.SX]:
        """Return Q and the gradient, with curvature if `newton` is 1.

        Curvature counts only while Q stays convex. The check covers the diagonal block of each mover, not the coupling of
        movers.
        """
        counts = ca.logic_and(newton, is_convex(self.Q + self.curvature, call))
        Q = self.Q + ca.if_else(counts, self.curvature, 0) + proximal_weight * self.proximal_hessian
        return Q, self.gradient + ca.if_else(counts, self.augmented_gradient, 0)


def quadratic_terms(
    system: GroupEquations, rows: Rows, motion: Motion, reactions: ca.SX, load: ca.SX, *, projects: bool
) -> QuadraticTerms:
    """Return the terms at the poses of `motion`.

    reactions   (row, 1) of the points in the previous step, and their sum `load` over all rows of the group
    projects    whether points may be projected in each step
    """
    size = system.z.numel()
    if system.group.has_springs:  # weak terms must not share the load with springs: they start from the present poses
        system = replace(system, raw=motion.poses)
    moved, nothing = motion.by(linear), ca.SX(size, size)
    goal = energy(system, moved)
    Q, gradient = (system.at_rest(expression) for expression in ca.hessian(goal.value, system.z))
    if not system.method.is_exact:
        return QuadraticTerms(Q, gradient, nothing, ca.SX(size, 1), nothing, goal.scale)
    Q += rows.hollow_curvature / goal.scale
    curvature = _lagrangian_hessian(system, motion.by(quadratic), rows.bends / goal.scale)
    curvature += (rows.hollow_curvature - rows.curvature) / goal.scale - Q
    # The augmented Lagrangian term of the active rows does not change the answer, and restores convexity in most cases.
    penalty = (1 + 2 * load / goal.scale / system.group.length) * ca.if_else(reactions > 0, rows.filled, 0)
    curvature += congruent(ca.diag(penalty), rows.slopes)
    row_values = rows.opened(reactions)
    proximal_hessian = system.curvature(proximity(system, motion.poses, moved)) / system.group.length if projects else nothing
    return QuadraticTerms(Q, gradient, curvature, rows.slopes.T @ (penalty * row_values), proximal_hessian, goal.scale)


def _lagrangian_hessian(system: GroupEquations, poses: Sequence[Pose], bends: ca.SX) -> ca.SX:
    """Return the Hessian, at z = 0, of the Lagrangian: the objective less the reactions' work on the gaps (linear in X_RM)."""
    weights = ca.SX.sym("bends", bends.numel())  # independent of z: symbols, so that they are not differentiated
    work = ca.dot(weights, ca.vertcat(*(X_RM.vector() for X_RM in system.relative(poses))))
    return ca.substitute(system.curvature(energy(system, poses).value - work), weights, bends)


def is_convex(Q: ca.SX, call: Call) -> ca.SX:
    """Return 1 if the diagonal blocks of Q are positive definite, else 0; a NaN pivot gives 0, too."""
    blocks = (Q[k : k + FREEDOMS, k : k + FREEDOMS] for k in range(0, Q.size1(), FREEDOMS))
    pivots = ca.vertcat(*(call("pivots", _pivots, block)[0] for block in blocks))
    return ca.mmin(ca.if_else(pivots > 0, 1, 0))


def _pivots(block: ca.SX) -> list[ca.SX]:
    return [ca.diag(ca.chol(ca.densify(block)))]
