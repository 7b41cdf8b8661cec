"""The terms of a contact QP: its rows, which are gaps to first order in the increments, and its objective to second order."""

import itertools
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.discretization import ContactPoints
from tolcontact.mechanics.correction import FREEDOMS, Motion, linear, quadratic
from tolcontact.mechanics.flexibility import Flexibility
from tolcontact.mechanics.gap import RowPoints
from tolcontact.mechanics.group_equations import GroupEquations
from tolcontact.mechanics.objective import energy, proximity
from tolcontact.mechanics.pair_gaps import pair_gaps
from tolcontact.mechanics.pose import ENTRIES, Pose, congruent
from tolcontact.method import Method

SLOTS, MANY_SLOTS = 8, 12  # of a pair of bounded faces, and of others; at most six independent rows can be active
Expression = Callable[..., Sequence[ca.SX]]
# How expressions are evaluated: `call(name, expression, *arguments, kind=...)` returns the results. Expressions of the same
# name and kind, for arguments of the same sparsity, differ only in their arguments.
Call = Callable[..., Sequence[ca.SX]]


def inline(name: str, expression: Expression, *arguments: ca.SX, kind: Hashable = ()) -> Sequence[ca.SX]:
    """Return the results of an expression as a part of the expressions of its arguments."""
    del name, kind
    return expression(*arguments)


class FunctionCalls:
    """Calls of Functions, one for all expressions that are the same: results do not contain their instructions."""

    def __init__(self) -> None:
        self._functions: dict[Hashable, ca.Function] = {}

    def __call__(self, name: str, expression: Expression, *arguments: ca.SX, kind: Hashable = ()) -> Sequence[ca.SX]:
        """Return the results."""
        key = name, kind, *(tuple(argument.sparsity().compress()) for argument in arguments)
        if key not in self._functions:
            symbols = [ca.SX.sym(f"i{k}", argument.sparsity()) for k, argument in enumerate(arguments)]
            self._functions[key] = ca.Function(name, symbols, expression(*symbols))
        never_inline = True
        return self._functions[key].call([*arguments], False, never_inline)  # type: ignore[no-any-return]


@dataclass(frozen=True, eq=False)
class Rows:
    """One row for each slot, and for each point that always has one; rows are ordered by pair.

    slopes      (row, z): derivatives of the gaps
    gaps        (row, 1) [mm] at z = 0
    filled      (row, 1): 0 if a slot is empty
    pairs       (row,): position of the row's pair in the group
    relative    (12 * pair, 1): X_RM of every pair, to first order in z
    bends       (12 * pair, 1): sums of previous reaction times gap gradient by the entries of X_RM
    compliance  (row, 1) [mm/N]: of compliant points; 0 for rigid rows
    flexibility of all rows, if there are elastic parts; `compliance` is then its diagonal
    bent        (row, 1) [mm]: opening of the rows by the previous reactions, if there are elastic parts
    curvature, hollow_curvature   (z, z): sums of previous reaction times second derivative of gaps that are not linear in X_RM
                (see round_gaps)
    """

    slopes: ca.SX
    gaps: ca.SX
    filled: ca.SX
    pairs: np.ndarray
    compliance: ca.SX
    relative: ca.SX
    bends: ca.SX
    curvature: ca.SX
    hollow_curvature: ca.SX
    flexibility: Flexibility | None = None
    bent: ca.SX | None = None

    def __len__(self) -> int:
        return len(self.pairs)

    @property
    def springs(self) -> list[int]:
        """The compliant rows."""
        return springs_of(self.compliance)

    def between_elastic(self, flexibility: Flexibility | None, bent: ca.SX | None) -> "Rows":
        """Return the rows between elastic parts, which previous reactions have `bent`; the same ones if there are none."""
        if flexibility is None:
            return self
        compliance = ca.SX(ca.sparsify(ca.DM(np.diag(flexibility.C))))
        return replace(self, gaps=self.gaps + flexibility.opening, compliance=compliance, flexibility=flexibility, bent=bent)


def springs_of(compliance: ca.SX) -> list[int]:
    """Return the rows with a nonzero compliance (row, 1)."""
    return [k for k in range(compliance.numel()) if not compliance[k].is_zero()]


def standing_points(pair: ContactPoints, gaps: Any, method: Method, *, is_searched: bool = False) -> np.ndarray | int:
    """Return the points of a pair that always have a row, or the number of its slots for changing points.

    Points that follow from every pose always have a row, unless they are searched at every pose. The same holds for points that
    can be the deepest, if they are few and fixed.
    """
    if is_searched:
        return MANY_SLOTS if pair.has_form else SLOTS
    if not pair.samples_faces or pair.is_springy:
        return np.arange(len(pair.P_m))
    are_few = method.is_closed and len(gaps.corners) <= MANY_SLOTS and pair.minima is None
    return gaps.corners if are_few else MANY_SLOTS


def contact_rows(
    system: GroupEquations,
    points_of_pairs: Sequence[RowPoints],
    start_poses: Sequence[Pose],
    end_poses: Sequence[Pose],
    reactions: ca.SX,
) -> Rows:
    """Return the rows about `start_poses`, which the increments change to `end_poses`.

    `reactions` (row, 1) are the reactions of the points in the previous step, see contact_qp.
    """
    pairs = list[int]()
    slopes, gaps, filled, compliance, relative, bends = ([] for _ in range(6))
    curvature, hollow_curvature = (ca.SX(system.z.numel(), system.z.numel()) for _ in range(2))
    for k, (start, by_z) in enumerate(relative_poses(system, start_poses, end_poses)):
        points, count = points_of_pairs[k], points_of_pairs[k].compliance.numel()
        of_pair = reactions[len(pairs) : len(pairs) + count]
        rows = pair_gaps(system.pair(k)).rows(start, by_z, system.heights[k], points, of_pair)
        pairs += [k] * count
        relative.append(start.vector() + by_z @ system.z)
        compliance.append(points.compliance)
        slopes.append(rows.slopes)
        gaps.append(rows.gaps)
        filled.append(ca.vertcat(*(is_filled for *_, is_filled in points.points)) if points.points else ca.SX.ones(count))
        bends.append(rows.bends)
        curvature += rows.curvature
        hollow_curvature += rows.hollow_curvature
    return Rows(
        slopes=ca.vertcat(ca.SX(0, system.z.numel()), *slopes),
        gaps=ca.vertcat(ca.SX(0, 1), *gaps),
        filled=ca.vertcat(ca.SX(0, 1), *filled),
        pairs=np.array(pairs),
        compliance=ca.vertcat(ca.SX(0, 1), *compliance),
        relative=ca.vertcat(ca.SX(0, 1), *relative),
        bends=ca.vertcat(ca.SX(0, 1), *bends),
        curvature=curvature,
        hollow_curvature=hollow_curvature,
    )


def relative_poses(
    system: GroupEquations, start_poses: Sequence[Pose], end_poses: Sequence[Pose]
) -> Iterator[tuple[Pose, ca.SX]]:
    """Yield X_RM of each pair at `start_poses`, and its derivatives (12, z); the increments lead to `end_poses`."""
    for start, end in zip(system.relative(start_poses), system.relative(end_poses), strict=True):
        yield start, system.slope(end.vector())


def spring_energy(system: GroupEquations, points_of_pairs: Sequence[RowPoints], poses: Sequence[Pose]) -> ca.SX:
    """Return the energy [N mm] of the compressed springs at `poses`; 0 without points."""
    energy = ca.SX(0)
    for k, (X_RM, points) in enumerate(zip(system.relative(poses), points_of_pairs, strict=bool(points_of_pairs))):
        springs = springs_of(points.compliance)
        gaps = pair_gaps(system.pair(k)).values(X_RM, system.heights[k], points) if springs else []
        energy += sum((ca.fmin(gaps[row], 0) ** 2 / (2 * points.compliance[row]) for row in springs), ca.SX(0))
    return energy


def row_points(system: GroupEquations, standing: Sequence[np.ndarray | int], inputs: Mapping[str, ca.SX]) -> list[RowPoints]:
    """Return the points of the group's pairs that have rows, see contact_qp for `standing` and `inputs`."""
    columns = (ca.horzsplit(values) for values in (inputs["P_m"], inputs["P_r"], inputs["n_r"], inputs["filled"].T))
    slots = zip(*columns, strict=True)
    bends = iter(ca.vertsplit(inputs["bend"], ENTRIES) if inputs["bend"].numel() else [])
    points_of_pairs = []
    for index, points in zip(system.group.pairs, standing, strict=True):
        pair = system.nominal.pairs[index]
        if isinstance(points, int):
            points_of_pairs.append(RowPoints(list(itertools.islice(slots, points)), ca.SX.zeros(points), next(bends)))
        else:
            compliance = np.zeros(len(pair.P_m)) if pair.stiffness is None else 1 / pair.stiffness
            rows = pair_gaps(pair).points(points, system.deviations)
            points_of_pairs.append(RowPoints(rows, ca.SX(ca.DM(compliance[points]))))
    return points_of_pairs


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
    # The Hessian, at z = 0, of the Lagrangian: the objective less the reactions' work on the gaps, which is linear in X_RM. Its
    # weights are independent of z: symbols, so that they are not differentiated.
    weights, moved_twice = ca.SX.sym("bends", rows.bends.numel()), motion.by(quadratic)
    work = ca.dot(weights, ca.vertcat(*(X_RM.vector() for X_RM in system.relative(moved_twice))))
    lagrangian = system.curvature(energy(system, moved_twice).value - work)
    curvature = ca.substitute(lagrangian, weights, rows.bends / goal.scale)
    curvature += (rows.hollow_curvature - rows.curvature) / goal.scale - Q
    # The augmented Lagrangian term of the active rows does not change the answer, and restores convexity in most cases.
    penalty = (1 + 2 * load / goal.scale / system.group.length) * ca.if_else(reactions > 0, rows.filled, 0)
    curvature += congruent(ca.diag(penalty), rows.slopes)
    opened = rows.gaps + (rows.compliance * reactions if rows.bent is None else rows.bent)  # [mm] at z = 0
    proximal_hessian = system.curvature(proximity(system, motion.poses, moved)) / system.group.length if projects else nothing
    return QuadraticTerms(Q, gradient, curvature, rows.slopes.T @ (penalty * opened), proximal_hessian, goal.scale)


def is_convex(Q: ca.SX, call: Call) -> ca.SX:
    """Return 1 if the diagonal blocks of Q are positive definite, else 0; a NaN pivot gives 0, too."""
    blocks = (Q[k : k + FREEDOMS, k : k + FREEDOMS] for k in range(0, Q.size1(), FREEDOMS))
    pivots = ca.vertcat(*(call("pivots", lambda block: [ca.diag(ca.chol(ca.densify(block)))], block)[0] for block in blocks))
    return ca.mmin(ca.if_else(pivots > 0, 1, 0))
