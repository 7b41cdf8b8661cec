"""Tolerance ranges of least cost for requirements on measures, with contact, and the tolerance to tighten first."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import VERIFICATION_FACTOR, Analysis, Progress, owners
from tolcontact.analyses.scaled_trials import (
    MIN_DECISIVE,
    STEP,
    Requirement,
    ScaledTrials,
    Trial,
    effect_samples,
    narrowing_effects,
)
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.method import Solver
from tolcontact.statistics.intervals import Estimate
from tolcontact.workflow.models import Choice, Model

MIN_FACTOR, MAX_FACTOR = 0.1, 3.0  # times the present range
MAX_STEPS, USUAL_STEPS = 24, 8  # of one search: at most, and for the forecast
FIRST_RADIUS, LAST_RADIUS = 0.5, 0.015  # of the trust region of a step, in logarithms of the factors
COMMON_FACTORS = np.geomspace(MIN_FACTOR, MAX_FACTOR, 13)  # of all ranges, where requirements cannot be met
PENALTY = 10.0  # for missed margins, as a multiple of the cost that these margins save to first order
MIN_GAIN, LAST_GAIN = 1e-4, 1e-3  # of the cost: smallest gain of an accepted step; smallest gain that leads to another step
VERIFICATIONS, AIM_GAIN = 6, 1.2  # fresh runs; the share of a missing margin that the next search aims for
Cost = float | Callable[[float], float]


def allocate(
    model: Model | Program, require: str | Sequence[str], *, costs: Mapping[str, Cost] | None = None,
    by: terms.GroupedBy = "contributor", samples: int = 8192, seed: int = 1, solver: Solver | None = None,
    method: Choice | None = None, into: str | Path | None = None, client: Any = None, progress: Progress | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return tolerance ranges of least cost that meet requirements on measures, with contact resolved.

        range        (group, stage)                      full width of the zones, "before" and "after"; NaN if they differ
        factor       (group)                             range after over range before, the same for all zones of the group
        cost         (group, stage)
        kept         (requirement, stage, interval)      the share outside the limits, or the Ppk, in a fresh run of
                                                         4 samples realizations, with its 95 % interval
        required     (requirement)                       the required share or Ppk
        met          (requirement)                       1: the whole interval of the fresh run after keeps the requirement;
                                                         0: no tolerances that were tried have such an interval, and `kept` is
                                                         the best one
        idle         (group)                             1: no influence on any requirement at any range; it keeps its range
        effect       (measure, of_effect, group, interval)  change of 6 sigma, and of the share outside, if a group's zones were
                                                         a tenth narrower: which to tighten first

    `require` is "corner height: ppm 1000" or "corner height: Ppk 1.33", or a list of such texts. `costs` maps a group that may
    change to a number c, for the cost c * present range / new range, or to a function of the factor. Groups without costs keep
    their ranges. If `costs` is left out, all groups may change with c = 1. `by` is as in `contributions`: "contributor",
    "feature" or "part".

    Ranges stay between a tenth and three times the present ones. Groups keep their ranges if no required measure changes in any
    resolved realization with all of them at either end. Each step replaces the margins of the requirements by functions of
    squared ranges with the same values and slopes, on the same draws; slopes come only from resolved realizations near the
    limits. SLSQP minimizes the cost within a trust region (a sequential separable approximation; Svanberg, 1987). The region
    shrinks when a step fails; a step also fails if more realizations are then not assemblable than may be outside. If the
    interval of the fresh run does not keep a requirement, the search continues with a larger margin. Effects come from
    samples / 4 realizations, or 4 samples / groups if that is less, but at least 512. `progress` is called with the number of
    simulated realizations, and about their total. Raises OptionError if no range varies. `model`, `seed`, `solver`, `method`,
    `into` and `client` are as in all analyses: `tc.analyses.allocate("model.py", "gap: ppm 1000", by="part")`.
    """
    analysis = Analysis(
        terms.ALLOCATION, model, samples=samples, seed=seed, solver=solver, method=method, into=into, client=client,
        progress=progress,
    )  # fmt: skip
    program = analysis.program
    requirements = _requirements(require, program, samples)
    curves = _curves(costs, groups := _groups(program, by))
    trials = ScaledTrials(analysis.engine(_expected(samples, len(groups))), list(groups.values()), requirements, seed, samples)
    prices = [curves.get(name, 0.0) for name in groups]
    search = Search(trials, prices, np.array([name in curves for name in groups]))
    fresh, estimates, is_met = _allocated(search, _expected(samples, 0))
    factors = np.exp(np.stack([np.zeros(len(groups)), fresh.logs], axis=1))
    values = {
        "range": np.array(_ranges(program, groups))[:, None] * factors,
        "factor": factors[:, 1],
        "cost": [[_cost(curve, factor) for factor in row] for curve, row in zip(prices, factors, strict=True)],
        "kept": np.array(estimates).swapaxes(0, 1),
        "met": np.array(is_met, dtype=np.int8),
        "required": [requirement.value for requirement in requirements],
        "idle": search.idle.astype(np.int8),
        "effect": narrowing_effects(trials),
    }
    labels = {terms.GROUP: list(groups), terms.REQUIREMENT: [requirement.name for requirement in requirements]}
    limits: dict[str, Any] = {"floor": MIN_FACTOR, "ceiling": MAX_FACTOR, "idle_tried": search.tested_rows}
    return analysis.dataset(values, labels, samples=samples, fresh=VERIFICATION_FACTOR * samples, by=by, **limits)


def _requirements(require: str | Sequence[str], program: Program, samples: int) -> list[Requirement]:
    """Return the requirements that texts state. Raises OptionError if there are none, or for too few samples."""
    requirements = [Requirement.parse(text, program) for text in ([require] if isinstance(require, str) else require)]
    if not requirements:
        raise OptionError('require is empty; expected a text such as "corner height: ppm 1000"')
    for requirement in requirements:
        requirement.check(samples)
    return requirements


def _groups(program: Program, by: str) -> dict[str, np.ndarray]:
    """Return the columns of deviations with ranges, by their owners."""
    groups: dict[str, list[int]] = {}
    contributors = program.draws.contributors
    for column, (owner, contributor) in enumerate(zip(owners(program, by), contributors, strict=True)):
        if np.isfinite(contributor.range) and contributor.range > 0:
            groups.setdefault(owner, []).append(column)
    if not groups:
        raise OptionError(f'"{program.nominal.assembly.name}" has no tolerance to allocate; give locators or features one')
    return {owner: np.array(columns) for owner, columns in groups.items()}


def _ranges(program: Program, groups: Mapping[str, np.ndarray]) -> list[float]:
    """Return the range of each group; NaN if its contributors have different ranges."""
    contributors = program.draws.contributors
    ranges = [{contributors[column].range for column in columns} for columns in groups.values()]
    return [widths.pop() if len(widths) == 1 else np.nan for widths in ranges]


def _curves(costs: Mapping[str, Cost] | None, groups: Mapping[str, np.ndarray]) -> dict[str, Cost]:
    if costs is None:
        return dict.fromkeys(groups, 1.0)
    for name, curve in costs.items():
        if name not in groups:
            raise OptionError(f'costs has "{name}"; expected some of: {", ".join(groups)}')
        if not callable(curve) and not (isinstance(curve, int | float) and np.isfinite(curve) and curve > 0):
            raise OptionError(
                f'cost of "{name}" is {curve!r}; expected a number above 0, or a function of the factor of its range'
            )
    if not costs:
        raise OptionError("costs is empty; name the groups that may change, or leave it out")
    return dict(costs)


def _cost(curve: Cost, factor: float) -> float:
    return float(curve(factor)) if callable(curve) else float(curve / factor)


def _expected(samples: int, groups: int) -> int:
    """Return the approximate number of realizations of a search and its verification, with slopes and effects of groups."""
    of_groups = USUAL_STEPS * MIN_DECISIVE + effect_samples(samples, groups)
    return (VERIFICATION_FACTOR + USUAL_STEPS) * samples + groups * of_groups


def _allocated(search: "Search", expected: int) -> tuple[Trial, list[list[Estimate]], np.ndarray]:
    """Return a fresh run with the allocated ranges, and estimates of the requirements in fresh runs, before and after.

    The last result states whether each requirement is met after (requirement,).
    """
    trials, requirements, nothing = search.trials, search.trials.requirements, np.zeros(len(search.priced))
    before = _estimates(requirements, trials.trial(nothing, verification=1))
    aims, searched = np.zeros(len(requirements)), trials.trial(nothing)
    search.release(searched)
    for number in range(VERIFICATIONS):
        searched = search.least_cost(searched, aims)
        fresh = trials.trial(searched.logs, verification=2 + number)
        missing = -_sure_margins(requirements, fresh.corrected)
        if (missing <= 0).all():
            break
        aims += AIM_GAIN * np.where(np.isfinite(missing), np.maximum(missing, 0.0), 0.0)
        trials.engine.total += expected
    else:
        searched = search.least_missing(searched)
        search.release(searched)
        fresh = trials.trial(searched.logs, verification=2 + VERIFICATIONS)
    return fresh, [before, _estimates(requirements, fresh)], _sure_margins(requirements, fresh.corrected) >= 0


def _estimates(requirements: Sequence[Requirement], trial: Trial) -> list[Estimate]:
    return [requirement.estimate(trial.corrected[:, requirement.measure]) for requirement in requirements]


def _margins(requirements: Sequence[Requirement], corrected: np.ndarray) -> np.ndarray:
    return np.array([requirement.margin(corrected[:, requirement.measure]) for requirement in requirements])


def _sure_margins(requirements: Sequence[Requirement], corrected: np.ndarray) -> np.ndarray:
    return np.array([requirement.sure_margin(corrected[:, requirement.measure]) for requirement in requirements])


@dataclass(eq=False)
class Search:
    """The search for the least cost with sufficient margins, in logarithms of the factors (group,).

    curves    cost of each group
    priced    (group,) whether the range of a group may change, unless it is idle
    """

    trials: ScaledTrials
    curves: Sequence[Cost]
    priced: np.ndarray
    idle: np.ndarray = field(init=False)  # (group,) whether a group has no known influence on any requirement
    tested_rows: int = field(init=False, default=0)  # number of realizations in the latest test of that

    def __post_init__(self) -> None:
        self.idle = self.priced.copy()

    @property
    def is_free(self) -> np.ndarray:
        """Whether the range of a group may change, (group,)."""
        return self.priced & ~self.idle

    def cost(self, logs: np.ndarray) -> float:
        """Return the cost of the groups that may change, at logarithms of the factors (group,)."""
        factors = zip(self.curves, np.exp(logs), self.priced, strict=True)
        return math.fsum(_cost(curve, factor) for curve, factor, is_priced in factors if is_priced)

    def release(self, trial: Trial) -> bool:
        """Free the ranges of idle groups that have an influence at a trial; return whether there are any."""
        before, self.tested_rows = self.idle, int(trial.is_resolved.sum())
        self.idle = self.trials.idle(trial, before, (MIN_FACTOR, MAX_FACTOR))
        return bool((before & ~self.idle).any())

    def least_cost(self, trial: Trial, aims: np.ndarray) -> Trial:
        """Return the trial of least cost with margins of at least `aims` (requirement,); the search starts at a trial.

        Groups that turn out to have an influence at the resulting ranges are added.
        """
        trial = self._descend(trial, aims)
        while self.release(trial):
            trial = self._descend(trial, aims)
        return trial

    def _descend(self, trial: Trial, aims: np.ndarray) -> Trial:
        """Return the trial of least cost that is reached by steps from a trial.

        The merit of a point is its cost plus a penalty for missed margins. A step that improves the merit is accepted, and the
        trust region of the next step doubles; after any other step the region halves. A step is rejected if more realizations
        are then unresolved than a requirement permits outside, unless there were as many before.
        """
        radius = FIRST_RADIUS
        margins, slopes = _margins(self.trials.requirements, trial.corrected) - aims, None
        allowed = min(requirement.share for requirement in self.trials.requirements) * len(trial.is_resolved)
        most_unresolved = max(int(allowed), int((~trial.is_resolved).sum()))
        for _ in range(MAX_STEPS):
            if radius < LAST_RADIUS:
                break
            if slopes is None:
                slopes = self._slopes(trial)
                scales = np.abs(slopes).sum(axis=1)  # margins in mm and in rad count alike
                scales[scales == 0] = 1.0
                penalty = PENALTY * self.cost(trial.logs) / scales
            logs = self._step(margins / scales, slopes / scales[:, None], trial.logs, radius)
            candidate = self.trials.trial_within(logs, most_unresolved)
            if candidate is None:
                radius /= 2
                continue
            candidate_margins = _margins(self.trials.requirements, candidate.corrected) - aims
            merit = self._merit(trial.logs, margins, penalty)
            gain = merit - self._merit(logs, candidate_margins, penalty)
            if gain > MIN_GAIN * abs(merit):
                trial, margins, slopes = candidate, candidate_margins, None
                radius = min(2 * radius, FIRST_RADIUS)
                if gain < LAST_GAIN * abs(merit):
                    break
            else:
                radius /= 2
        return trial

    def least_missing(self, trial: Trial) -> Trial:
        """Return the trial that misses the requirements least: this one, or all free ranges times a common factor.

        Margins lead to points where a quantile is near its limit, which may be far from most values.
        """
        common = [np.where(self.is_free, log, 0.0) for log in np.log(COMMON_FACTORS[::-1])]  # the widest that miss nothing
        return min([trial, *map(self.trials.trial, common)], key=self._missing)

    def _missing(self, trial: Trial) -> float:
        return math.fsum(
            requirement.shortfall(trial.corrected[:, requirement.measure]) for requirement in self.trials.requirements
        )

    def _merit(self, logs: np.ndarray, margins: np.ndarray, penalty: np.ndarray) -> float:
        return self.cost(logs) + float(penalty @ np.maximum(-margins, 0))

    def _slopes(self, trial: Trial) -> np.ndarray:
        """Return derivatives (requirement, group) of the margins, by central differences; 0 for groups that do not change.

        A margin depends on the realizations beyond it and near it (Hong, 2009): only these are simulated again if they are
        resolved, and the measures of the others do not change.
        """
        corrected, slopes = trial.corrected, np.zeros((len(self.trials.requirements), len(trial.logs)))
        rows = np.unique(np.concatenate([r.decisive(corrected[:, r.measure]) for r in self.trials.requirements]))
        rows, groups = rows[trial.is_resolved[rows]], np.flatnonzero(self.is_free)
        of_signs = [self.trials.changes(trial, groups, rows, trial.logs + step) for step in (STEP, -STEP)]
        for group, (wider, wider_values), (narrower, narrower_values) in zip(groups, *of_signs, strict=True):
            wide, narrow = corrected.copy(), corrected.copy()
            wide[wider], narrow[narrower] = wider_values, narrower_values
            for row, requirement in enumerate(self.trials.requirements):
                margins = [requirement.smooth_margin(x[:, requirement.measure]) for x in (wide, narrow)]
                slopes[row, group] = (margins[0] - margins[1]) / (2 * STEP)
        return slopes

    def _step(self, margins: np.ndarray, slopes: np.ndarray, logs: np.ndarray, radius: float) -> np.ndarray:
        """Return the point of least cost with margins approximated by functions of squared ranges.

        If no point within the radius has sufficient margins, return the point that misses them least.
        """

        def missed(point: np.ndarray) -> float:
            return float(np.maximum(-approximate(point), 0).sum())

        def approximate(point: np.ndarray) -> np.ndarray:
            return np.asarray(margins + slopes @ (np.exp(2 * (point - logs)) - 1) / 2)

        lower = np.where(self.is_free, np.maximum(logs - radius, np.log(MIN_FACTOR)), logs)
        upper = np.where(self.is_free, np.minimum(logs + radius, np.log(MAX_FACTOR)), logs)
        bounds = scipy.optimize.Bounds(lower, upper)
        solution = scipy.optimize.minimize(
            self.cost, logs, method="SLSQP", bounds=bounds, constraints={"type": "ineq", "fun": approximate},
            options={"maxiter": 200},
        )  # fmt: skip
        if not solution.success:
            solution = scipy.optimize.minimize(missed, logs, method="SLSQP", bounds=bounds)
        return np.asarray(np.clip(solution.x, lower, upper))
