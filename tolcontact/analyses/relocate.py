"""The position of a locator, within a box, that minimizes the variation of a measure, with contact."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import VERIFICATION_FACTOR, Analysis, Progress
from tolcontact.analyses.requirements import Corrected
from tolcontact.compilation import Program, compile_program
from tolcontact.declaration import Locator, ThreeTwoOne
from tolcontact.discretization import Nominal, NominalPart, discretize
from tolcontact.errors import ModelError, OptionError
from tolcontact.limits import Limits
from tolcontact.method import Solver
from tolcontact.statistics import intervals
from tolcontact.statistics.capability import share_outside
from tolcontact.statistics.intervals import UNDEFINED, Estimate
from tolcontact.statistics.measure_statistics import MIN_VALUES, StatisticRequest
from tolcontact.statistics.sample import Sample
from tolcontact.workflow.models import DEFAULT_SOLVER, Choice, Model

GRID_POINTS = {1: 9, 2: 5, 3: 4}  # trial positions along each side, by the number of sides
MAX_TRIALS = 40  # after the grid, starting at its best position
POSITION_TOLERANCE = 1e-3  # of the sides: final accuracy of the search
SIX_SIGMA = "6 sigma"
EXAMPLES = (f"corner height: {SIX_SIGMA}", f"gap: {terms.PPM}")


def relocate(
    model: Model, locator: str, *, between: tuple[Any, Any], least: str, samples: int = 4096, seed: int = 1,
    solver: Solver = DEFAULT_SOLVER, method: Choice | None = None, into: str | Path | None = None, client: Any = None,
    progress: Progress | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return the best position of a locator, "part.locator", in the box `between` two corners, in its part's own frame [mm].

        point        (stage, axis)      its position "before" and "after" [mm]
        reached      (stage, interval)  the statistic `least` in a fresh run of 4 samples realizations, with its 95 % interval
        change       (interval)         6 sigma after / before, or the share outside after minus before, for the same draws
        unresolved   (stage)            number of unresolved realizations in the fresh run
        tried        (trial, axis)      all trial positions [mm]
        tried_value  (trial)            the statistic there; infinite where the model cannot be built

    The locator stays where it is, with equal points before and after, if no trial is better, or if the fresh run does not
    confirm the best one.

    `least` is "corner height: 6 sigma", or "corner height: ppm" (the share outside its limits). Realizations that cannot be
    assembled count as outside, and 6 sigma leaves them out, as in summaries. A coordinate that is the same in both corners does
    not change. The locator keeps its direction, so choose corners on the surface that it contacts. All trials use the same
    draws: first a grid and the present position, then scipy's COBYQA starting at the best of them. The statistic may have
    several minima, or be flat: see `tried_value`. Each trial compiles a model. `progress` is called with the number of trials,
    and their largest number.
    `model`, `samples` (4096 by default), `seed`, `solver`, `method`, `into` and `client` are as in all analyses (see
    tolcontact.analyses). Raises OptionError for a locator, a box or a measure that does not exist.

    `tc.analyses.relocate("model.py", "lid.A3", between=((0, 25, 0), (50, 25, 0)), least="gap: 6 sigma")`
    """
    analysis = Analysis(
        terms.RELOCATION, model, samples=samples, seed=seed, solver=solver, method=method, into=into, client=client,
        progress=progress,
    )  # fmt: skip
    analysis.expect(VERIFICATION_FACTOR * samples)
    measure, limits, units = _goal(least, analysis.program)
    trials = TrialPositions(analysis, locator, measure, limits, _corners(between))
    trials.search()
    best = trials.best
    before, after = (trials.measured(point, fresh=True) for point in (trials.point, best))
    if not goal_estimate(after, limits).value < goal_estimate(before, limits).value:
        best, after = trials.point, before
    values = {
        "point": [trials.point, best],
        "reached": [goal_estimate(before, limits), goal_estimate(after, limits)],
        "change": _change(before, after, limits),
        "unresolved": [int((~run.is_resolved).sum()) for run in (before, after)],
        "tried": trials.points,
        "tried_value": trials.values,
    }
    attributes = {"locator": locator, "least": least, "samples": samples, "fresh": VERIFICATION_FACTOR * samples}
    return analysis.dataset(values, {}, units=units, **attributes)


def _goal(least: str, program: Program) -> tuple[int, Limits | None, str]:
    """Return the index of the measure, its limits if the share outside is to be least, and the units of the statistic.

    Raises OptionError for texts that are not like "corner height: 6 sigma" or "gap: ppm".
    """
    request = StatisticRequest.parse(least, "least", statistics=(SIX_SIGMA, terms.PPM), examples=EXAMPLES)
    measures = program.nominal.measures
    measure = request.number_of([measure.name for measure in measures])
    if request.statistic == SIX_SIGMA:
        return measure, None, measures[measure].units
    limits = program.limits(measure)
    if limits.are_open:
        raise OptionError(f"least is {least!r}, and the measurement has no limits; give it tolerance=... or limits=...")
    return measure, limits, "1"


def goal_estimate(corrected: Corrected, limits: Limits | None) -> Estimate:
    """Return the share outside limits or not assemblable, or 6 sigma without limits, with its interval."""
    existing = corrected.existing(0)
    if limits is not None:
        return share_outside(Sample.of(existing), limits, corrected.count - len(existing))
    return intervals.standard_deviation(existing, times=6) if len(existing) >= MIN_VALUES else UNDEFINED


def _change(before: Corrected, after: Corrected, limits: Limits | None) -> Estimate:
    """Return the change between realizations of the same draws: a ratio of 6 sigma, or a difference of shares."""
    if after is before:
        return Estimate(*[float(limits is None)] * 3)
    if limits is not None:
        hits = [Sample.of(limits.outside(run.values[:, 0]) | ~run.is_assembled) for run in (after, before)]
        return intervals.share_shift(*hits, paired=True)
    both = before.is_assembled & after.is_assembled
    if both.sum() < MIN_VALUES:
        return UNDEFINED
    return Estimate(*np.sqrt(intervals.variance_ratio(after.values[both, 0], before.values[both, 0])))


class TrialPositions:
    """Simulations of the assembly with a locator at trial positions in a box, on the same draws.

    points, values  of all trials: positions (3,) [mm], and the values of the goal
    """

    def __init__(
        self, analysis: Analysis, locator: str, measure: int, limits: Limits | None, box: tuple[np.ndarray, np.ndarray]
    ) -> None:  # fmt: skip
        self._analysis, self._locator, self._measure, self._limits = analysis, locator, measure, limits
        self._lower, self._upper = lower, upper = box
        self._sides = np.flatnonzero(upper > lower)
        self._count = GRID_POINTS[len(self._sides)]
        self.points: list[np.ndarray] = []
        self.values: list[float] = []
        nominal = analysis.program.nominal
        if locator not in nominal.locators.labels:
            raise OptionError(f'there is no locator "{locator}"; expected one of: {", ".join(nominal.locators.labels)}')
        self._part = next(part for part in nominal.parts if locator in part.locators.labels)
        self._scheme = _declared_locators(nominal, self._part)
        self._number = self._part.locators.labels.index(locator)
        owner = nominal.parts[self._part.owners[self._number]] if self._part.owners else self._part
        if owner.part.elasticity and owner.part.elasticity.stiffness:
            raise OptionError(
                f'locator "{locator}" holds part "{owner.name}", {owner.part.elasticity}, at a node of its matrix, and there '
                "is none between nodes; declare the part elastic by E and nu, or compare models with the locator at other nodes"
            )

    @property
    def point(self) -> np.ndarray:
        """The declared position of the locator, (3,) [mm]."""
        return np.array(self._scheme[self._number].point)

    @property
    def best(self) -> np.ndarray:
        """The best position so far, (3,) [mm]."""
        return self.points[int(np.nanargmin(self.values))]

    def measured(self, point: np.ndarray, *, fresh: bool = False) -> Corrected:
        """Return the measure of the goal alone, with the locator at a point (3,) [mm].

        A `fresh` run has other draws, and more of them.
        """
        analysis, scheme = self._analysis, list(self._scheme)
        scheme[self._number] = replace(scheme[self._number], point=(point[0], point[1], point[2]))
        solver, method = analysis.program.solver.name, analysis.program.method
        part, station, assembly = self._part.part, self._part.station, analysis.program.nominal.assembly
        locations = [
            replace(x, scheme=tuple(scheme)) if x.part is part and x.station == station else x for x in assembly.locations
        ]
        nominal = discretize(assembly.replaced(locations=locations), presses=method.minimizes.presses)
        start = VERIFICATION_FACTOR * analysis.samples if fresh else 0
        measured, status = analysis.of(compile_program(nominal, solver, method)).simulate(
            start or analysis.samples, start=start
        )
        return Corrected(measured[:, terms.CORRECTED, [self._measure]], status)

    def search(self) -> None:
        """Try a grid of positions and the declared one, and then further ones, starting at the best one."""
        sides, axes = self._sides, [np.linspace(0, 1, self._count)] * len(self._sides)
        for shares in np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(sides)):
            self._attempt(self._at(shares))
        if not np.isfinite(self.values).any():
            lower, upper = self._lower.tolist(), self._upper.tolist()
            raise OptionError(f'"{self._locator}" cannot stand anywhere between {lower} and {upper}; choose other corners')
        self._attempt(self.point)
        start = ((self.best - self._lower)[sides] / (self._upper - self._lower)[sides]).clip(0.0, 1.0)
        ceiling = 1e3 * max(value for value in self.values if np.isfinite(value))  # COBYQA does not accept infinity
        scipy.optimize.minimize(
            lambda shares: min(self._attempt(self._at(shares)), ceiling),
            start, method="COBYQA", bounds=scipy.optimize.Bounds(np.zeros(len(start)), np.ones(len(start))),
            options={"maxfev": MAX_TRIALS, "initial_tr_radius": 0.5 / self._count, "final_tr_radius": POSITION_TOLERANCE},
        )  # fmt: skip

    def _at(self, shares: np.ndarray) -> np.ndarray:
        """Return the position (3,) [mm] at shares (side,) of the sides."""
        point = self._lower.copy()
        point[self._sides] += shares * (self._upper - self._lower)[self._sides]
        return point

    def _attempt(self, point: np.ndarray) -> float:
        """Return the value of the goal at a position (3,) [mm], also outside the box; infinite if there is no model."""
        try:
            value = goal_estimate(self.measured(point), self._limits).value
        except ModelError:
            value = np.inf
        self.points.append(point)
        self.values.append(value)
        if progress := self._analysis.progress:
            progress(len(self.values), self._count ** len(self._sides) + 1 + MAX_TRIALS)
        return value


def _declared_locators(nominal: Nominal, part: NominalPart) -> tuple[Locator, ...]:
    """Return the locators of a part in its own frame, or of a joint in the frames of its parts, as in a script."""
    if not isinstance(part.scheme, ThreeTwoOne):
        return part.scheme or ()
    locators, scheme = part.locators, list[Locator]()
    owners = [nominal.parts[owner] for owner in part.owners] or [part] * len(locators)
    for number, owner in enumerate(owners):
        (R_WP, t_WP), face = owner.placement, locators.faces[number]
        on = next((feature for feature in owner.part.features if face and face.name == f"{owner.name}.{feature.name}"), None)
        point, direction = ((locators.points - t_WP) @ R_WP)[number], (locators.directions @ R_WP)[number]
        name, point_of = locators.labels[number].removeprefix(f"{part.located}."), owner.part if part.owners else None
        scheme.append(Locator(name, point, direction, on=on, part=point_of))
    return tuple(scheme)


def _corners(between: tuple[Any, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and the upper corner (3,) of a box."""
    try:
        lower, upper = (np.array(corner, dtype=float) for corner in between)
    except (TypeError, ValueError):
        lower = upper = np.empty(0)
    if lower.shape != (3,) or upper.shape != (3,) or not np.isfinite([lower, upper]).all() or not (lower != upper).any():
        raise OptionError(f"between is {between!r}; expected two different corners, such as ((0, 0, 0), (50, 25, 0)) [mm]")
    return np.minimum(lower, upper), np.maximum(lower, upper)
