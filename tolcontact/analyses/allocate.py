"""Tolerance ranges of least cost for requirements on measures, with contact, and the tolerance to tighten first."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import VERIFICATION_FACTOR, Analysis, Answer, Progress, owners
from tolcontact.analyses.costs import MAX_FACTOR, MIN_FACTOR, Cost, Curve, cheapest, constant, curves_of
from tolcontact.analyses.requirements import MIN_DECISIVE, Requirement, requirements_of
from tolcontact.analyses.scaled_trials import STEP, ScaledTrials, Trial, effect_samples, narrowing_effects
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.method import Solver
from tolcontact.statistics.intervals import Estimate
from tolcontact.workflow.models import Choice, Model

MAX_STEPS, USUAL_STEPS = 24, 8  # of one search: at most, and for the forecast
FIRST_RADIUS, LAST_RADIUS = 0.5, 0.015  # of the trust region of a step, in logarithms of the factors
COMMON_FACTORS = np.geomspace(MIN_FACTOR, MAX_FACTOR, 13)  # of all ranges, where requirements cannot be met
PENALTY = 10.0  # for missed margins, as a multiple of the cost that these margins save to first order
MIN_GAIN, LAST_GAIN = 1e-4, 1e-3  # of the cost: smallest gain of an accepted step; smallest gain that leads to another step
MAX_CHOICES = 8  # binary programs of one search
COARSE, PRESENT = "figures of a search that has not ended, in its own realizations", "figures of present tolerances"
VERIFICATIONS, AIM_GAIN = 6, 1.2  # fresh runs; the share of a missing margin that the next search aims for


def allocate(
    model: Model | Program, require: str | Sequence[str], *, costs: Mapping[str, Cost] | None = None,
    by: terms.GroupedBy = "contributor", samples: int = 8192, seed: int = 1, solver: Solver | None = None,
    method: Choice | None = None, into: str | Path | None = None, client: Any = None, progress: Progress | None = None,
    minutes: float | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return tolerance ranges of least cost that meet requirements on measures, with contact resolved.

        range        (group, stage)                      full width of the zones, "before" and "after"; NaN if they differ
        factor       (group)                             range after over range before, the same for all zones of the group
        cost         (group, stage)
        kept         (requirement, stage, interval)      the share outside the limits or not assemblable, or the Ppk, in a fresh
                                                         run of 4 samples realizations, with its 95 % interval
        required     (requirement)                       the required share or Ppk
        met          (requirement)                       1: the whole interval of the fresh run after keeps the requirement;
                                                         0: no tolerances that were tried have such an interval, and `kept` is
                                                         the best one
        idle         (group)                             1: no influence on any requirement at any range; it keeps its range
        effect       (measure, of_effect, group, interval)  change of 6 sigma, and of the share outside, if a group's zones were
                                                         a tenth narrower: which to tighten first

    `require` is "corner height: ppm 1000" or "corner height: Ppk 1.33", or a list of such texts. `costs` maps a group that may
    change to a number c, for the cost c * present range / new range, or to a function of the factor, or to a table of choices:
    {0.1: 4, 0.2: 2.5} of full widths, or {"IT6": 4, "IT7": 2.5} of ISO 286-1 grades for a group with a tc.Size. A size with a
    class keeps its letters: IT8 of an h9 is h8, with the limits of that class. Any other zone keeps its middle. Groups without
    costs keep their ranges. If `costs` is left out, all groups may change with c = 1. `by` is as in `contributions`:
    "contributor", "feature" or "part".

    A zone without grades is widened about its middle, and the limits of a size move with it: the bonus of a position at maximum
    material counts from the limit of the widened size. Ranges without a table stay between a tenth and three times the present
    ones. Groups keep their ranges, or the next narrower choice, if no required measure changes in any resolved realization with
    all of them at either end. Each step replaces margins by functions of squared ranges with their values and slopes, on the
    same draws. SLSQP minimizes the cost within a trust region (a sequential separable approximation; Svanberg, 1987). A step
    fails if more realizations are then not assemblable than may be outside. Choices come from a linear program with binary
    unknowns on such functions. If a fresh run does not keep a requirement, the margin of the search grows. `progress` is called
    with numbers of realizations. Raises OptionError if no range varies. By default there are 8192 `samples`; `model`, `seed`,
    `solver`, `method`, `into`, `client` and `minutes` are as in all analyses: `tc.analyses.allocate("model.py", "gap: ppm
    1000", by="part")`.
    """
    analysis = Analysis(
        terms.ALLOCATION, model, samples=samples, seed=seed, solver=solver, method=method, into=into, client=client,
        progress=progress, minutes=minutes,
    )  # fmt: skip
    requirements = requirements_of(require, program := analysis.program, samples)
    curves = curves_of(costs, groups := _groups(program, by), ranges := _ranges(program, groups), program)
    analysis.expect(_expected(samples, len(groups)))
    prices = [curves.get(name, constant(0.0)) for name in groups]
    trials = ScaledTrials(analysis, list(groups.values()), requirements, prices)
    search = Search(trials, prices, np.array([name in curves for name in groups]))
    return analysis.finest(_answers(search, groups, ranges, by))


def _answers(
    search: "Search", groups: Mapping[str, np.ndarray], ranges: Sequence[float], by: str
) -> Iterator[Callable[[], Answer]]:
    """Yield present ranges, those of the search as they change, and the allocated ones."""
    trials, requirements = search.trials, search.trials.requirements
    samples, count = trials.analysis.samples, len(trials.analysis.program.nominal.measures)
    unknown = np.full((count, len(terms.EFFECTS), len(groups), len(terms.ESTIMATE)), np.nan)

    def answer(trial: Trial, before: list[Estimate], fresh: int, effect: np.ndarray = unknown) -> Answer:
        factors = np.exp(np.stack([np.zeros(len(groups)), trial.logs], axis=1))
        values = {
            "range": np.array(ranges)[:, None] * factors,
            "factor": factors[:, 1],
            "cost": [[curve(factor) for factor in row] for curve, row in zip(search.curves, factors, strict=True)],
            "kept": np.array([before, _estimates(requirements, trial)]).swapaxes(0, 1),
            "met": np.array([requirement.sure_margin(trial.corrected) >= 0 for requirement in requirements], dtype=np.int8),
            "required": [requirement.value for requirement in requirements],
            "idle": search.idle.astype(np.int8) if search.tested_rows else np.zeros(len(groups), dtype=np.int8),
            "effect": effect,
        }
        chosen = zip(groups, search.curves, trial.logs, strict=True)
        choices = [f"{name}: {curve.names[curve.nearest(log)]}" for name, curve, log in chosen if curve.names]
        labels = {terms.GROUP: list(groups), terms.REQUIREMENT: [requirement.name for requirement in requirements]}
        attributes = {
            "by": by, "samples": samples, "fresh": fresh, "idle_tried": search.tested_rows, "floor": MIN_FACTOR,
            "ceiling": MAX_FACTOR, "choices": ", ".join(choices),
        }  # fmt: skip
        return Answer(values, labels, attributes, COARSE if trial.logs.any() else PRESENT)

    nothing = np.zeros(len(search.priced))
    search.latest = trials.trial(search.narrowed(nothing))
    present = _estimates(requirements, search.latest if not search.latest.logs.any() else trials.trial(nothing))
    yield lambda: answer(search.latest, present, samples)
    before = _estimates(requirements, trials.trial(nothing, verification=1))
    yield lambda: answer(search.latest, before, samples)
    fresh = _allocated(search, _expected(samples, 0))
    effects = narrowing_effects(replace(trials, curves=()))  # about the middles of the zones
    yield lambda: answer(fresh, before, VERIFICATION_FACTOR * samples, effects)


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


def _expected(samples: int, groups: int) -> int:
    """Return the approximate number of realizations of a search and its verification, with slopes and effects of groups."""
    of_groups = USUAL_STEPS * MIN_DECISIVE + effect_samples(samples, groups)
    return (VERIFICATION_FACTOR + USUAL_STEPS) * samples + groups * of_groups


def _allocated(search: "Search", expected: int) -> Trial:
    """Return a fresh run with the allocated ranges, for a search from its latest trial."""
    trials, requirements = search.trials, search.trials.requirements
    aims, searched = np.zeros(len(requirements)), search.latest
    search.release(searched)
    for number in range(VERIFICATIONS):
        searched = search.least_cost(searched, aims)
        fresh = trials.trial(searched.logs, verification=2 + number)
        missing = -np.array([requirement.sure_margin(fresh.corrected) for requirement in requirements])
        if (missing <= 0).all():
            return fresh
        aims += AIM_GAIN * np.where(np.isfinite(missing), np.maximum(missing, 0.0), 0.0)
        trials.analysis.total += expected
    searched = search.least_missing(searched)
    search.release(searched)
    return trials.trial(searched.logs, verification=2 + VERIFICATIONS)


def _estimates(requirements: Sequence[Requirement], trial: Trial) -> list[Estimate]:
    return [requirement.estimate(trial.corrected) for requirement in requirements]


@dataclass(eq=False)
class Search:
    """The search for the least cost with sufficient margins, in logarithms of the factors (group,).

    curves    cost of each group
    priced    (group,) whether the range of a group may change, unless it is idle
    """

    trials: ScaledTrials
    curves: Sequence[Curve]
    priced: np.ndarray
    latest: Trial = field(init=False)  # the best trial so far
    chosen: bool = field(init=False, default=False)  # whether groups with a table keep their choices
    idle: np.ndarray = field(init=False)  # (group,) whether a group has no known influence on any requirement
    tested_rows: int = field(init=False, default=0)  # number of realizations in the latest test of that

    has_table: np.ndarray = field(init=False)  # (group,) whether the cost of a group is a table of choices
    least: np.ndarray = field(init=False)  # (group,) the logarithm of the smallest factor that a group may have
    most: np.ndarray = field(init=False)  # (group,) the logarithm of the largest one

    def __post_init__(self) -> None:
        self.idle = self.priced.copy()
        self.has_table = np.array([bool(curve.names) for curve in self.curves])
        self.least, self.most = np.array([curve.ends for curve in self.curves]).T

    def narrowed(self, logs: np.ndarray) -> np.ndarray:
        """Return logarithms of the factors (group,) with the next narrower choices of tables."""
        return np.array([curve.narrowed(log) for curve, log in zip(self.curves, logs, strict=True)])

    @property
    def is_free(self) -> np.ndarray:
        """Whether the range of a group may change, (group,)."""
        return self.priced & ~self.idle & ~(self.chosen & self.has_table)

    def cost(self, logs: np.ndarray) -> float:
        """Return the cost of the groups that may change, at logarithms of the factors (group,)."""
        factors = zip(self.curves, np.exp(logs), self.priced, strict=True)
        return math.fsum(curve(factor) for curve, factor, is_priced in factors if is_priced)

    def release(self, trial: Trial) -> bool:
        """Free the ranges of idle groups that have an influence at a trial; return whether there are any."""
        before, self.tested_rows = self.idle, int(trial.is_resolved.sum())
        self.idle = self.trials.idle(trial, before, (math.exp(self.least.min()), math.exp(self.most.max())))
        return bool((before & ~self.idle).any())

    def least_cost(self, trial: Trial, aims: np.ndarray) -> Trial:
        """Return the trial of least cost with margins of at least `aims` (requirement,); the search starts at a trial.

        Groups that turn out to have an influence at the resulting ranges are added.
        """
        trial = self._descend(trial, aims)
        while self.release(trial):
            trial = self._descend(trial, aims)
        return self._choose(trial, aims) if (self.has_table & self.is_free).any() else trial

    def _choose(self, trial: Trial, aims: np.ndarray) -> Trial:
        """Return the trial of least cost with choices of tables, of those that are best by approximations of the margins.

        Each approximation is made at the choices before. Ranges without a table are searched with the choices kept. If no
        choices have sufficient margins, the narrowest are taken.
        """
        best, tried = None, set[bytes]()
        for _ in range(MAX_CHOICES):
            margins = self._margins(trial) - aims
            logs = cheapest(self.curves, trial.logs, self.is_free, margins, self._slopes(trial))
            logs = np.where(self.is_free, self.least, trial.logs) if logs is None else logs
            if logs.tobytes() in tried:
                break
            tried.add(logs.tobytes())
            trial = self.trials.trial(logs)
            self.chosen = True
            trial = self._descend(trial, aims) if self.is_free.any() else trial
            self.chosen = False
            is_met = (self._margins(trial) >= aims).all()
            if is_met and (best is None or self.cost(trial.logs) < self.cost(best.logs)):
                best = trial
        return best or self.trials.trial(np.where(self.is_free, self.least, trial.logs))

    def _descend(self, trial: Trial, aims: np.ndarray) -> Trial:
        """Return the trial of least cost that is reached by steps from a trial.

        The merit of a point is its cost plus a penalty for missed margins. A step that improves the merit is accepted, and the
        trust region of the next step doubles; after any other step the region halves. A step is rejected if more realizations
        are then unresolved than a requirement permits outside, unless there were as many before.
        """
        radius = FIRST_RADIUS
        margins, slopes = self._margins(trial) - aims, None
        allowed = min(requirement.share for requirement in self.trials.requirements) * len(trial.is_resolved)
        most_unresolved = max(int(allowed), int((~trial.is_resolved).sum()))
        for _ in range(MAX_STEPS):
            if radius < LAST_RADIUS:
                break
            if slopes is None:
                slopes = self._slopes(trial)
                scales = np.abs(slopes).sum(axis=1)  # margins in mm and in rad count equally
                scales[scales == 0] = 1.0
                penalty = PENALTY * self.cost(trial.logs) / scales
            logs = self._step(margins / scales, slopes / scales[:, None], trial.logs, radius)
            candidate = self.trials.trial_within(logs, most_unresolved)
            if candidate is None:
                radius /= 2
                continue
            candidate_margins = self._margins(candidate) - aims
            merit = self._merit(trial.logs, margins, penalty)
            gain = merit - self._merit(logs, candidate_margins, penalty)
            if gain > MIN_GAIN * abs(merit):
                trial, margins, slopes = candidate, candidate_margins, None
                self.latest = trial
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
        logs = np.log(COMMON_FACTORS[::-1])  # the widest that miss nothing
        common = [self.narrowed(np.where(self.is_free, log, trial.logs)) for log in logs]
        return min([trial, *map(self.trials.trial, common)], key=self._missing)

    def _missing(self, trial: Trial) -> float:
        return math.fsum(requirement.shortfall(trial.corrected) for requirement in self.trials.requirements)

    def _margins(self, trial: Trial) -> np.ndarray:
        return np.array([requirement.margin(trial.corrected) for requirement in self.trials.requirements])

    def _merit(self, logs: np.ndarray, margins: np.ndarray, penalty: np.ndarray) -> float:
        return self.cost(logs) + float(penalty @ np.maximum(-margins, 0))

    def _slopes(self, trial: Trial) -> np.ndarray:
        """Return derivatives (requirement, group) of the margins, by central differences; 0 for groups that do not change.

        A margin depends on the realizations beyond it and near it (Hong, 2009): only these are simulated again if they are
        resolved, and the measures of the others do not change.
        """
        corrected, slopes = trial.corrected, np.zeros((len(self.trials.requirements), len(trial.logs)))
        rows = np.unique(np.concatenate([requirement.decisive(corrected) for requirement in self.trials.requirements]))
        rows, groups = rows[trial.is_resolved[rows]], np.flatnonzero(self.is_free)
        of_signs = [self.trials.changes(trial, groups, rows, trial.logs + step) for step in (STEP, -STEP)]
        for group, (wider, wider_values), (narrower, narrower_values) in zip(groups, *of_signs, strict=True):
            wide, narrow = corrected.replaced(wider, wider_values), corrected.replaced(narrower, narrower_values)
            margins = [[requirement.smooth_margin(x) for requirement in self.trials.requirements] for x in (wide, narrow)]
            slopes[:, group] = np.subtract(*np.array(margins)) / (2 * STEP)
        return slopes

    def _step(self, margins: np.ndarray, slopes: np.ndarray, logs: np.ndarray, radius: float) -> np.ndarray:
        """Return the point of least cost with margins approximated by functions of squared ranges.

        If no point within the radius has sufficient margins, return the point that misses them least.
        """

        def missed(point: np.ndarray) -> float:
            return float(np.maximum(-approximate(point), 0).sum())

        def approximate(point: np.ndarray) -> np.ndarray:
            return np.asarray(margins + slopes @ (np.exp(2 * (point - logs)) - 1) / 2)

        lower = np.where(self.is_free, np.maximum(logs - radius, self.least), logs)
        upper = np.where(self.is_free, np.minimum(logs + radius, self.most), logs)
        bounds = scipy.optimize.Bounds(lower, upper)
        solution = scipy.optimize.minimize(
            self.cost, logs, method="SLSQP", bounds=bounds, constraints={"type": "ineq", "fun": approximate},
            options={"maxiter": 200},
        )  # fmt: skip
        if not solution.success:
            solution = scipy.optimize.minimize(missed, logs, method="SLSQP", bounds=bounds)
        return np.asarray(np.clip(solution.x, lower, upper))
