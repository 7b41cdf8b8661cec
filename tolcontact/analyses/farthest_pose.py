"""Bounds of measures over everything that drawings allow, in the linear model: no pose free of penetration lies beyond.

With any objective, gaps are non-negative at the corrected pose, and bilateral locators keep their positions where forces press.
So the largest value of a measure over all deviations and all these poses is a linear program. Its zones are approximated by
tangents (Kelley, 1960), and each round gives an outer bound of the measure. This is the worst case with float of fasteners.
Where only the objective holds a part, for instance a part that contact may lift without limit, the bound is infinite.

The objective "all points" has the same quadratic term everywhere. Here the optimality conditions are added to the program, with
a binary variable for each row that may be active or open; HiGHS also gives a bound for this program when its time is up.

A measure with a kink at the nominal assembly (a minimum, a clearance, an angle that is nominally 0) has no linear model, and
no bound.

The bounds are of first order in deviations and motions. Pairs of round faces and springy supports have no rows, which only
widens the bounds.
"""

import itertools
from typing import Any

import numpy as np
import scipy

from tolcontact import vocabulary as terms
from tolcontact.analyses.allowed_space import AllowedRegion
from tolcontact.analyses.linear_model import LinearModel
from tolcontact.compilation import Program

MAX_ROUNDS = 30
SLACK = 1e-7  # of a zone's width
MAX_BINARY, MAX_SECONDS = 64, 30.0  # rows that may be active or open; time for one bound
MAX_CONDITION = 1e8  # of the objective's quadratic term: above this, contact points do not constrain all freedoms


def farthest_poses(program: Program, region: AllowedRegion, model: LinearModel) -> np.ndarray:
    """Return bounds (measure, state, end); bounds of the raw state are without contact."""
    bounds = np.empty((len(model.measures), len(terms.STATES), len(terms.ENDS)))
    # With stations, reactions in a later one do not act on the motions in an earlier one.
    has_optimum = program.method.objective == "all points" and not program.stations
    problems = [_Problem(model, region), _Problem(model, region, is_moved=True, has_optimum=has_optimum)]
    for measure, (end, sense) in itertools.product(range(len(model.measures)), enumerate(terms.SENSES)):
        unbounded = model.kinked[0, measure], model.kinked[:, measure].any()
        bounds[measure, :, end] = [
            sense * np.inf if is_unbounded else model.measures[measure] + sense * problem.bound(measure, sense)
            for problem, is_unbounded in zip(problems, unbounded, strict=True)
        ]
    return bounds


class _Problem:
    """Linear constraints on points x of the region, with motions y if `is_moved`.

    With the optimality conditions of the objective "all points", also on reactions r, and on binaries b of rows that are active
    (1) or open (0).
    """

    def __init__(
        self, model: LinearModel, region: AllowedRegion, *, is_moved: bool = False, has_optimum: bool = False
    ) -> None:  # fmt: skip
        self._region, self._model = region, model
        self._freedoms = model.by_motion.shape[1] if is_moved else 0
        limits = self._limits() if has_optimum else None
        contributors, binaries = len(region.lower), 0 if limits is None else len(model.gaps)
        self._width = contributors + self._freedoms + 2 * binaries
        self._integer = np.r_[np.zeros(self._width - binaries), np.ones(binaries)]
        lower, upper = np.full(self._width, -np.inf), np.full(self._width, np.inf)
        lower[:contributors], upper[:contributors] = region.lower, region.upper
        self._constraints: list[scipy.optimize.LinearConstraint] = []
        gaps = np.hstack([region.slopes(model.gaps_by_deviations), model.gaps_by_motion])
        if self._freedoms:  # gaps are non-negative, and bilateral locators keep their positions
            self._constraints += self._rows(gaps, -model.gaps, np.inf)
            self._constraints += self._rows(np.hstack([np.zeros((len(model.bilateral), contributors)), model.bilateral]), 0, 0)
        if limits is not None:
            largest_gap, largest_reaction = limits
            lower[-2 * binaries :], upper[-2 * binaries :] = 0.0, np.r_[largest_reaction, np.ones(binaries)]
            eye, zeros = np.eye(binaries), np.zeros((binaries, binaries))
            # Reactions balance the objective's gradient; a row is active only if its gap is closed.
            balance = np.hstack([np.zeros((self._freedoms, contributors)), _hessian(model), -model.gaps_by_motion.T])
            self._constraints += self._rows(balance, 0, 0)
            self._constraints += self._rows(np.hstack([np.zeros_like(gaps), eye, -largest_reaction * eye]), -np.inf, 0)
            self._constraints += self._rows(np.hstack([gaps, zeros, largest_gap * eye]), -np.inf, largest_gap - model.gaps)
        self._bounds = scipy.optimize.Bounds(lower, upper)

    def _limits(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Return bounds of gaps at a corrected pose (row,) [mm], and of reactions (row,).

        The result is None if there are too many rows, if contact points do not constrain all freedoms, or if no motion opens
        all gaps.
        """
        model, region = self._model, self._region
        A, hessian = model.gaps_by_motion, _hessian(model)
        if not 0 < len(A) <= MAX_BINARY or model.round_pairs or np.linalg.cond(hessian) >= MAX_CONDITION:
            return None
        # A motion d that opens all gaps by 1, with the least sum of |d|: nearly the least energy suffices.
        lift = scipy.optimize.linprog(np.ones(2 * A.shape[1]), -np.hstack([A, -A]), -np.ones(len(A)))
        if not lift.success:
            return None
        d = np.subtract(*np.split(lift.x, 2))
        energy = float(np.sqrt(d @ hessian @ d))
        slopes = region.slopes(model.gaps_by_deviations)
        centre, reach = (region.lower + region.upper) / 2, np.abs(slopes) @ ((region.upper - region.lower) / 2)
        lowest, highest = model.gaps + slopes @ centre - reach, model.gaps + slopes @ centre + reach
        deepest = max(float(-lowest.min()), 0.0)
        # The corrected motion has no more energy than `deepest` d, which opens all gaps; this also bounds the sum of reactions.
        opening = np.sqrt(np.einsum("ij,jk,ik->i", A, np.linalg.inv(hessian), A)) * deepest * energy
        return np.maximum(highest + opening, 1e-9), np.full(len(A), max(deepest, 1e-9) * energy**2)

    def _rows(self, rows: np.ndarray, lower: np.ndarray | float, upper: np.ndarray | float) -> list[Any]:
        """Return the constraint with rows (row, variable) of the first variables; nothing if there are no rows."""
        padded = np.pad(rows, ((0, 0), (0, self._width - rows.shape[1])))
        return [scipy.optimize.LinearConstraint(padded, lower, upper)] if len(rows) else []

    def bound(self, measure: int, sense: int) -> float:
        """Return an upper bound of sense * (measure - nominal); infinite if there is none."""
        goal, contributors = np.zeros(self._width), len(self._region.lower)
        goal[:contributors] = sense * self._region.slopes(self._model.by_deviations[measure])
        goal[contributors : contributors + self._freedoms] = sense * self._model.by_motion[measure, : self._freedoms]
        constraints, bound, (planes, ends) = list(self._constraints), np.inf, self._region.planes()
        for _ in range(MAX_ROUNDS):
            constraints += self._rows(planes, -np.inf, ends)
            # With presolve, HiGHS prints a line when an integer solution needs another solve in the space of all variables.
            solution = scipy.optimize.milp(
                -goal, constraints=constraints, bounds=self._bounds, integrality=self._integer,
                options={"time_limit": MAX_SECONDS, "presolve": not self._integer.any()},
            )  # fmt: skip
            if solution.x is None:
                break
            bound = min(bound, -float(solution.mip_dual_bound if self._integer.any() else solution.fun))
            planes, ends = self._region.planes(solution.x[:contributors], SLACK)
            if not len(planes):
                break
        return bound


def _hessian(model: LinearModel) -> np.ndarray:
    """Return the quadratic term (freedom, freedom) of the objective "all points"."""
    return np.asarray(2 * model.displacements.T @ model.displacements)
