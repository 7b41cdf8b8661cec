"""Bounds of measures over all that drawings allow, in the linear model: beyond them lies no pose free of penetration.

Whatever an objective makes of contact, gaps are open at the corrected pose, and two-sided locators hold where forces press. So
the largest value of a measure over all deviations and all such poses is a linear program, whose zones are cut out by tangents
(Kelley, 1960): each round bounds the measure from outside. This is the worst case with float of fasteners. Where only the
objective holds a part, such as one that contact may lift without end, it says nothing: the bound is infinite.

The objective "all points" has the same quadratic term everywhere. There the optimality conditions join the program, with a
binary number for each row that may carry or be open; HiGHS bounds that, too, when its time is up.

To first order in deviations and motions; pairs of round faces have no rows, which only widens the bounds.
"""

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp

from tolcontact import vocabulary as terms
from tolcontact.analyses.allowed_space import Region
from tolcontact.analyses.linear_model import LinearModel
from tolcontact.compilation import Program

ROUNDS = 30
SLACK = 1e-7  # of a zone's width
MOST_BINARY, SECONDS = 64, 30.0  # rows that may carry or be open; time for one bound


def farthest_poses(program: Program, region: Region, model: LinearModel) -> np.ndarray:
    """Bounds (measure, state, end); those of the raw state are without contact."""
    found = np.empty((len(model.measures), len(terms.STATES), len(terms.ENDS)))
    carrying = _Optimality(model, region) if program.method.objective == "all points" else None
    for measure in range(len(model.measures)):
        for end, sense in enumerate(terms.SENSES):
            raw = _Problem(model, region, measure, sense, is_moved=False, carrying=None)
            moved = _Problem(model, region, measure, sense, is_moved=True, carrying=carrying)
            found[measure, :, end] = [model.measures[measure] + sense * each.bound() for each in (raw, moved)]
    return found


class _Optimality:
    """What the objective "all points" adds: reactions, and how large they and gaps can be.

    Is `usable` if some motion opens all gaps at once, and contact points hold all freedoms.
    """

    def __init__(self, model: LinearModel, region: Region) -> None:
        A = model.gaps_by_motion
        self.hessian = 2 * model.displacements.T @ model.displacements
        self.usable = 0 < len(A) <= MOST_BINARY and not model.round_pairs and np.linalg.cond(self.hessian) < 1e8
        if not self.usable:
            return
        # The motion d of least energy that opens all gaps by 1: the dual of a small QP, as a linear program is enough here.
        freedoms = A.shape[1]
        lift = milp(
            np.r_[np.zeros(freedoms), np.ones(freedoms)],
            constraints=[
                LinearConstraint(np.hstack([A, np.zeros_like(A)]), 1.0, np.inf),
                LinearConstraint(np.hstack([np.eye(freedoms), np.eye(freedoms)]), 0.0, np.inf),
                LinearConstraint(np.hstack([-np.eye(freedoms), np.eye(freedoms)]), 0.0, np.inf),
            ],
            bounds=Bounds(-np.inf, np.inf),
        )
        if not lift.success:
            self.usable = False
            return
        d = lift.x[:freedoms]
        energy = float(np.sqrt(d @ self.hessian @ d))
        slopes = region.slopes(model.gaps_by_deviations)
        middle, half = (region.lower + region.upper) / 2, (region.upper - region.lower) / 2
        lowest = model.gaps + slopes @ middle - np.abs(slopes) @ half
        highest = model.gaps + slopes @ middle + np.abs(slopes) @ half
        deepest = max(float(-lowest.min()), 0.0)
        # The corrected motion has no more energy than `deepest` d, which opens all gaps; its reactions sum to as much.
        reach = np.sqrt(np.einsum("ij,jk,ik->i", A, np.linalg.inv(self.hessian), A)) * deepest * energy
        self.gap = np.maximum(highest + reach, 1e-9)
        self.reaction = np.full(len(A), max(deepest, 1e-9) * energy**2)


class _Problem:
    """The largest sense * (measure - nominal) over own deviations x, motions y, and (reactions r, binaries b)."""

    def __init__(
        self, model: LinearModel, region: Region, measure: int, sense: int, *, is_moved: bool, carrying: _Optimality | None
    ) -> None:
        self._region = region
        contributors = len(region.lower)
        freedoms = model.by_motion.shape[1] if is_moved else 0
        binaries = len(model.gaps) if is_moved and carrying is not None and carrying.usable else 0
        self._width = contributors + freedoms + 2 * binaries
        goal = np.zeros(self._width)
        goal[:contributors] = sense * region.slopes(model.by_deviations[measure])
        goal[contributors : contributors + freedoms] = sense * model.by_motion[measure, :freedoms]
        self._goal = goal
        self._integer = np.r_[np.zeros(self._width - binaries), np.ones(binaries)]
        lower, upper = np.full(self._width, -np.inf), np.full(self._width, np.inf)
        lower[:contributors], upper[:contributors] = region.lower, region.upper
        self._constraints: list[LinearConstraint] = []
        if freedoms:
            gaps = np.hstack([region.slopes(model.gaps_by_deviations), model.gaps_by_motion])
            self._add(gaps, -model.gaps, np.inf)
            self._add(np.hstack([np.zeros((len(model.held), contributors)), model.held]), 0.0, 0.0)
        if binaries and carrying is not None:
            eye, none = np.eye(binaries), np.zeros((binaries, binaries))
            lower[-2 * binaries :], upper[-2 * binaries :] = 0.0, np.r_[carrying.reaction, np.ones(binaries)]
            stationary = np.hstack([np.zeros((freedoms, contributors)), carrying.hessian, -model.gaps_by_motion.T])
            self._add(stationary, 0.0, 0.0)
            # A row carries (1), or is open (0).
            self._add(np.hstack([np.zeros_like(gaps), eye, -carrying.reaction * eye]), -np.inf, 0.0)
            self._add(np.hstack([gaps, none, carrying.gap * eye]), -np.inf, carrying.gap - model.gaps)
        self._bounds = Bounds(lower, upper)

    def _add(self, rows: np.ndarray, lower: np.ndarray | float, upper: np.ndarray | float) -> None:
        """Rows (row, variable) of the first variables."""
        if len(rows):
            self._constraints.append(LinearConstraint(np.pad(rows, ((0, 0), (0, self._width - rows.shape[1]))), lower, upper))

    def bound(self) -> float:
        """An upper bound; infinite if there is none."""
        planes, ends = self._region.planes()
        least, contributors = np.inf, len(self._region.lower)
        for _ in range(ROUNDS):
            self._add(planes, -np.inf, ends)
            found = milp(
                -self._goal, constraints=self._constraints, bounds=self._bounds, integrality=self._integer,
                options={"time_limit": SECONDS},
            )  # fmt: skip
            if found.x is None:
                break
            least = min(least, -float(found.mip_dual_bound if self._integer.any() else found.fun))
            planes, ends = self._region.planes(found.x[:contributors], SLACK)
            if not len(planes):
                break
        return least
