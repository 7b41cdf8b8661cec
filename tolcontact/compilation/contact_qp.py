"""The contact QP of one group of parts, as one CasADi Function, paper (9) to (12).

min 1/2 y'Hy + f'y + sum (L s_k + 1/2 s_k^2)   subject to   g_i + A_i y + SLACK s_k >= 0,  h_j + B_j y = 0,  s_k >= 0

The increments z = (dt, L w) of a mover, all in mm (L is the length of the group), are z = U^-1 y, where U'U is the diagonal
block of the mover in (11). H then has unit blocks on its diagonal, and degrees of freedom that only the regularization
constrains are as well conditioned as the others. The slacks s_k, one for each pair k, make the problem feasible for all gaps.
Their exact penalty keeps them zero unless the rows contradict each other. f is the gradient of the objective at the present
poses; without forces, it is zero in the raw state. h are the two-sided locators, if the objective makes them exact."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from tolcontact.compilation.conditioning import conditioned, outcome
from tolcontact.compilation.functions import NamedFunction
from tolcontact.compilation.pair_terms import is_summed, summed_terms
from tolcontact.compilation.qp_terms import (
    Call,
    FunctionCalls,
    contact_rows,
    inline,
    quadratic_terms,
    row_points,
    spring_energy,
)
from tolcontact.discretization import Nominal
from tolcontact.mechanics.correction import FREEDOMS, linear, published, rigid
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.flexibility import Flexibility
from tolcontact.mechanics.group_equations import GroupEquations, face_heights, face_poses
from tolcontact.mechanics.groups import Group, curved_pairs
from tolcontact.mechanics.objective import energy
from tolcontact.mechanics.placement import bilateral_steps, misfit
from tolcontact.mechanics.pose import ENTRIES, poses_of
from tolcontact.method import Method

Standing = Sequence[np.ndarray | int]  # see ContactQP
ENERGY_INPUTS = ("poses", "raw", "moments", "deviations")
MAX_BATCH, MIN_BATCH = 1024, 16  # realizations that are solved together
MAX_ENTRIES = 4_000_000  # of the inputs and outputs of `assemble` in a batch, so that they take little memory


class Evaluators(NamedTuple):
    """The functions of a QP for many realizations; inputs and outputs are arrays (realization, entry) by name."""

    assemble: Callable[..., dict[str, np.ndarray]]
    finish: Callable[..., dict[str, np.ndarray]]
    energy: Callable[..., dict[str, np.ndarray]]
    relate: Callable[..., dict[str, np.ndarray]]


@dataclass(frozen=True, eq=False)
class ContactQP:
    """The Functions of a group: `assemble` makes the QP of the inputs, a solver solves it, `finish` makes the outputs.

    energy       poses, raw, moments, deviations -> the objective at `poses` (realization, 1) [mm^2], or [mm] for seating
    relate       poses, deviations -> X_RM of the pairs at `poses`
    slacks       number of slacks: the QP's last variables, which are not negative, except for slacks of elastic parts
    has_springs  whether any row is compliant
    equations    number of equations: the QP's last rows, for two-sided locators that the objective makes exact
    standing     for each pair of the group the contact points that always have a row, or the number of its slots
    scale        multipliers times this are reactions, in the units of the objective; NaN if it differs by realization
    length       [mm] of the group
    flexibility  of the rows; None without elastic parts

    Elastic parts bend by slacks s without bounds, which open many rows. With L L' = C they open the rows by L s and cost s's/2,
    so that s = L'l for the reactions l, and the gaps open by C l. C is the same in all realizations. So `assemble` leaves these
    columns out, `finish` judges answers by C l, and plugins get L.
    """

    assemble: ca.Function
    finish: ca.Function
    energy: ca.Function
    relate: ca.Function
    slacks: int
    has_springs: bool
    equations: int
    standing: Standing
    scale: float
    length: float
    flexibility: Flexibility | None = None

    @property
    def free_slacks(self) -> int:
        """The number of slacks of elastic parts: the last of all variables, without bounds."""
        return 0 if self.flexibility is None else len(self.flexibility.rows)

    @property
    def max_batch(self) -> int:
        """The number of realizations that are solved together."""
        entries = self.assemble.nnz_in() + self.assemble.nnz_out()
        return min(MAX_BATCH, max(MIN_BATCH, MAX_ENTRIES // entries))

    @property
    def evaluators(self) -> Evaluators:
        """The functions for many realizations, which threads may share."""
        dense = (NamedFunction.dense(function) for function in (self.energy, self.relate))
        return Evaluators(NamedFunction(self.assemble), NamedFunction(self.finish), *dense)

    @cached_property
    def _flexible_entries(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Row, column and value of the entries of L, column by column, for multipliers of rows that are not scaled."""
        assert self.flexibility is not None
        L = self.flexibility.factor
        columns, rows = np.nonzero(L.T)
        return self.flexibility.rows[rows], columns, L[rows, columns] * np.sqrt(self.scale)

    def sparsity(self, name: str) -> ca.Sparsity:
        """Return the sparsity of an output of `assemble`, with the columns of elastic parts."""
        sparsity, count = self.assemble.sparsity_out(name), self.free_slacks
        if not count or name not in ("h", "g", "a"):
            return sparsity
        if name == "h":
            return ca.diagcat(sparsity, ca.Sparsity.diag(count))
        if name == "g":
            return ca.vertcat(sparsity, ca.Sparsity.dense(count, 1))
        rows, columns, _ = self._flexible_entries
        starts = np.searchsorted(columns, np.arange(count + 1))
        return ca.horzcat(sparsity, ca.Sparsity(sparsity.size1(), count, starts.tolist(), rows.tolist()))

    def whole(self, problem: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
        """Return the outputs of `assemble` (realization, entry) with the columns of elastic parts."""
        if self.flexibility is None:
            return problem
        rows, _, values = self._flexible_entries
        ones = np.ones((len(problem["h"]), self.free_slacks))
        added = {"h": ones, "g": 0 * ones, "a": values / problem["length"][:, rows]}
        return dict(problem) | {name: np.concatenate([problem[name], entries], axis=1) for name, entries in added.items()}

    @property
    def spans(self) -> list[slice]:
        """The range of rows of each pair in the group."""
        ends = np.cumsum([0, *(row_count(points) for points in self.standing)])
        return [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]


def row_count(points: np.ndarray | int) -> int:
    """Return the number of rows of a pair with these standing points, or slots."""
    return points if isinstance(points, int) else len(points)


def contact_qp(
    nominal: Nominal,
    group: Group,
    method: Method,
    standing: Standing,
    call: Call | None = None,
    flexibility: Flexibility | None = None,
) -> ContactQP:
    """Return the Functions of a group.

    `standing` lists the points of each pair of the group that always have a row, or the number of its slots. `call`
    evaluates what recurs, by default in place, or with many bodies by FunctionCalls; both give the same results up to rounding.
    `flexibility` belongs to the rows if there are elastic parts.
    `_inputs` describes the inputs. The outputs for `p` parts, `q` pairs and `k` rows are:

    corrected (12 p)     poses after the correction; in an exact resolution after the share of it that `stride` allows
    linearized (12 q)    X_RM of every pair, linear in the increments, as the QP constrains it
    relative (12 q)      X_RM of every pair at `corrected`
    multipliers (k)      reactions of the rows, >= 0, in the units of the objective (see Objective)
    residual             KKT residual [mm], in y: the largest of max |Hy + f - A'lambda|, max |min(row, lambda)| with rows of
                         length 1, and the depth of any gap that remains negative
    slack (q)            penetration of each pair that no increment could remove, to first order [mm]
    step (2)             largest increment (dt, L w) of a mover [mm], and the same in the norm of the objective, max |y|, of
                         the whole correction
    locator_residual     largest misfit [mm] of exact two-sided locators at `corrected`
    """
    inputs = _inputs(nominal, group, standing, bends=flexibility is not None)
    system = _equations(nominal, group, method, inputs)
    motion = system.motion(poses_of(inputs["poses"]))
    current, moved, reactions = motion.poses, motion.by(linear), inputs["reactions"]
    points = row_points(system, standing, inputs)
    call = call or (FunctionCalls() if is_summed(group, method) and flexibility is None else inline)
    projects = bool(curved_pairs(nominal, group))
    if isinstance(call, FunctionCalls):
        rows, terms = summed_terms(system, points, current, reactions, call, projects=projects)
    else:
        rows = contact_rows(system, points, current, moved, reactions).between_elastic(flexibility, inputs.get("bent"))
        terms = quadratic_terms(system, rows, motion, reactions, ca.sum1(reactions), projects=projects)
    exact = misfit(system, moved, linear=True) if method.minimizes.presses else ca.SX(0, 1)
    problem = conditioned(
        system, *terms.summed(inputs["newton"], inputs["proximal_weight"], call), rows, exact, terms.scale, call
    )
    end = motion.by(rigid if method.is_exact else published)
    solution, results = outcome(system, terms.scale, rows, end, problem, inputs["stride"], call)
    pure_energy = ca.substitute(energy(system, current).value, inputs["regularization_factor"], 1)
    pure_energy += spring_energy(system, points if flexibility is None else [], current) / terms.scale
    relative = ca.vertcat(*(X.vector() for X in system.relative(current)))
    return ContactQP(
        assemble=_function("assemble", inputs, problem),
        finish=_function("finish", inputs | solution, results),
        energy=_function("energy", {name: inputs[name] for name in ENERGY_INPUTS}, {"energy": pure_energy}),
        relate=_function("relate", {name: inputs[name] for name in ("poses", "deviations")}, {"relative": relative}),
        slacks=len(group.pairs) + len(rows.springs),
        has_springs=group.has_springs,
        equations=exact.numel(),
        standing=standing,
        scale=float(terms.scale) if terms.scale.is_constant() else np.nan,
        length=float(group.length),
        flexibility=flexibility,
    )


def _equations(nominal: Nominal, group: Group, method: Method, inputs: Mapping[str, ca.SX]) -> GroupEquations:
    """Return the equations of a group, with symbols for its increments."""
    pairs = [nominal.pairs[index] for index in group.pairs]
    return GroupEquations(
        nominal, group, method, raw=poses_of(inputs["raw"]), z=ca.SX.sym("z", FREEDOMS * len(group.free)),
        **{name: inputs[name] for name in ("moments", "deviations", "regularization_factor")},
        faces=[face_poses(pair, inputs["deviations"]) for pair in pairs],
        heights=[face_heights(pair, inputs["deviations"]) for pair in pairs],
        steps=[bilateral_steps(nominal, group.parts[locators.part], inputs["deviations"]) for locators in group.bilateral],
    )  # fmt: skip


def _inputs(nominal: Nominal, group: Group, standing: Standing, *, bends: bool = False) -> dict[str, ca.SX]:
    """Return the symbols of all inputs by name, for `p` parts, `k` rows and contributors (c).

    If only few points of a pair can be the deepest, each of them always has a row. The `v` other pairs have slots, `m` in all,
    for changing points.

    poses (12 p)         poses of the group's parts: the gaps are linearized about them
    raw (12 p)           raw poses of the group's parts, which displacements are measured from
    moments (10, sides)  moments of the weighted points of each side in the objective
    deviations (c)       deviations of all contributors of the model, and the gaps that welds keep
    regularization_factor    factor of the regularization: 1, or more in early steps
    newton               1 to count the curvature of objective and gaps, 0 for the linear step of the paper
    stride               in an exact resolution: step bound, the largest rotation angle [rad] of a mover
    proximal_weight      if points are projected in each step: weight of the proximal term, the squared motion of all contact
                         points in the step
    reactions (k)        if `newton`: the reaction of each row's point in the previous step
    bent (k)             if there are elastic parts: opening [mm] of each row by the reactions; in `assemble` the previous ones
    bend (12 v)          if `newton`: sum, over the points in the slots of the previous step, of reaction times gap gradient by
                         the entries of X_RM
    P_m, P_r, n_r (3, m) the contact points in the slots
    filled (m)           1 if a slot holds a point, 0 if it is empty
    """
    slots_of_pairs = [points for points in standing if isinstance(points, int)]
    varying, slots, rows = len(slots_of_pairs), sum(slots_of_pairs), sum(row_count(points) for points in standing)
    shapes = {
        "poses": (ENTRIES * len(group.parts), 1),
        "raw": (ENTRIES * len(group.parts), 1),
        "moments": (MOMENTS, len(group.sides)),
        "deviations": (nominal.input_count, 1),
        "regularization_factor": (1, 1),
        "newton": (1, 1),
        "stride": (1, 1),
        "proximal_weight": (1, 1),
        "reactions": (rows, 1),
        "bend": (ENTRIES * varying, 1),
        "P_m": (3, slots),
        "P_r": (3, slots),
        "n_r": (3, slots),
        "filled": (slots, 1),
    }
    if bends:
        shapes["bent"] = (rows, 1)
    return {name: ca.SX.sym(name, *shape) for name, shape in shapes.items()}


def _function(name: str, inputs: Mapping[str, ca.SX], outputs: Mapping[str, ca.SX]) -> ca.Function:
    return ca.Function(name, [*inputs.values()], [*outputs.values()], [*inputs], [*outputs])
