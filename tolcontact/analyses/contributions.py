"""Contributions to the variance of a measure, with and without contact.

Screening: few realizations show which groups of contributors matter for any measure; the others are estimated as one group.
The total index of a set of groups is at least the total index of each group in it: T_i <= T_u for i in u. So the joint total
index of all minor groups bounds the first-order and total index of each of them, and costs as much as one group.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import Analysis, Engine, Progress, independent_groups, owners
from tolcontact.analyses.answers import Answer, stages
from tolcontact.analyses.designs import MixedDraws, ReleasedDraws
from tolcontact.analyses.linear_model import total_derivatives
from tolcontact.compilation import Program
from tolcontact.method import Solver
from tolcontact.simulation import Block
from tolcontact.statistics.intervals import UNDEFINED, Estimate, effective_count
from tolcontact.statistics.variance_shares import missed, shapley_effects, sobol_indices
from tolcontact.workflow.models import Choice, Model

MIN_GROUPS = 17  # fewer are not screened
SCREENING_SAMPLES, START = 128, 1 << 38  # base realizations of a screening, and the number of the first one
MINOR_SHARE = 0.01  # of the variance of any measure in any state: the largest joint share of minor groups
MIN_EFFECTIVE = 16  # effective base realizations behind the variance of a measure: with fewer, no group is minor
BUDGET = 60_000  # realizations in total that determine the default number of base realizations
MIN_SAMPLES, MAX_SAMPLES = 512, 4096  # base realizations by default


@dataclass(frozen=True, eq=False)
class Screening:
    """Groups of contributors, divided into major and minor ones.

    groups     columns of deviations by group
    is_minor   (group,)
    totals     (measure, state, group): rough total indices; NaN where nothing varies
    """

    groups: Mapping[str, np.ndarray]
    is_minor: np.ndarray
    totals: np.ndarray

    @classmethod
    def none(cls, groups: Mapping[str, np.ndarray]) -> "Screening":
        """Return a screening without minor groups."""
        return cls(groups, np.zeros(len(groups), dtype=bool), np.zeros((0, 0, len(groups))))

    @property
    def estimated(self) -> list[np.ndarray]:
        """The columns of the estimated groups: each major group, then all minor groups as one, if there are any."""
        columns = list(self.groups.values())
        minor = [columns[k] for k in np.flatnonzero(self.is_minor)]
        return [columns[k] for k in np.flatnonzero(~self.is_minor)] + ([np.concatenate(minor)] if minor else [])

    def of_all_groups(
        self, estimates: tuple[list[Estimate], list[Estimate]], measure: int, state: int
    ) -> tuple[list[Estimate], list[Estimate], Estimate]:
        """Return first-order and total indices of all groups, and the joint total index of the minor ones.

        `estimates` are first-order and total indices of the estimated groups. The interval of a minor group extends from 0 to
        the joint upper bound of all minor groups.
        """
        if not self.is_minor.any():
            return *estimates, Estimate(0.0, 0.0, 0.0)
        together = estimates[1][-1]
        bounded = [self._bounded(float(total), together) for total in self.totals[measure, state]]
        first_order, total = (
            [bounded[k] if minor else next(major) for k, minor in enumerate(self.is_minor)] for major in map(iter, estimates)
        )
        return first_order, total, together

    def _bounded(self, total: float, together: Estimate) -> Estimate:
        """Return the index of a minor group from its rough total and the joint total of all minor groups."""
        if np.isnan(together.value):
            return UNDEFINED
        upper = together.value if np.isnan(together.upper) else max(together.upper, 0.0)
        return Estimate(min(np.nan_to_num(total), upper), 0.0 * together.upper, together.upper)


class ScreeningRun:
    """A screening of groups by total indices, with separate realizations; few groups are all estimated."""

    def __init__(self, engine: Engine, groups: Mapping[str, np.ndarray], seed: int) -> None:
        self._engine, self._groups, self._seed = engine, groups, seed
        self.observed = Observed(MixedDraws(engine.program.draws, list(groups.values())))

    def stages(self) -> Iterator[int]:
        """Simulate more and more realizations, and yield the numbers of base realizations."""
        for start, stop in stages(SCREENING_SAMPLES, self.observed.design.size):
            self.observed.simulate(self._engine, stop - start, seed=self._seed, start=START + start)
            yield stop

    def screening(self) -> Screening:
        """Return the screening by all realizations."""
        groups, (measured, _) = self._groups, self.observed.arrays
        totals, accuracies = [], self._engine.program.accuracies
        for states, accuracy in zip(measured.transpose(3, 2, 0, 1), accuracies, strict=True):
            totals.append([[index.value for index in sobol_indices(f, accuracy)[1]] for f in states])
            squares = [((f[:, :2] - f[:, :2].mean()) ** 2).mean(axis=1) for f in states]
            if any(0 < effective_count(square) < MIN_EFFECTIVE for square in squares):
                return Screening.none(groups)
        shares = np.nan_to_num(np.array(totals)).reshape(-1, len(groups))
        order = np.argsort(shares.max(axis=0, initial=0.0), kind="stable")
        is_minor = np.zeros(len(groups), dtype=bool)
        is_minor[order] = (shares[:, order].cumsum(axis=1) <= MINOR_SHARE).all(axis=0)
        return Screening(groups, is_minor, np.array(totals)) if is_minor.sum() > 1 else Screening.none(groups)


class Observed:
    """The measures of a design (base, realization, state, measure), and deviations (base, contributor) of its first members."""

    def __init__(self, design: MixedDraws) -> None:
        self.design = design
        self._parts: list[tuple[np.ndarray, ...]] = []

    def simulate(self, engine: Engine, samples: int, *, seed: int, start: int) -> None:
        """Add `samples` base realizations."""
        observe = partial(_first_deviations, self.design.size)
        self._parts.append(engine.simulate_design(self.design, samples, seed=seed, start=start, observe=observe)[:2])

    @property
    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Both arrays of all base realizations."""
        measured, deviations = (np.concatenate(part) for part in zip(*self._parts, strict=True))
        return measured, deviations[:, 0]


def contributions(
    model: Model | Program, *, samples: int | None = None, seed: int = 1, solver: Solver | None = None,
    method: Choice | None = None, by: terms.GroupedBy = "contributor", into: str | Path | None = None, client: Any = None,
    progress: Progress | None = None, minutes: float | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return Sobol' indices of each measure (see tolcontact.statistics.variance_shares), and the classical linear percentages.

        first   (measure, state, group, interval)   share of variance by a group alone, with its 95 % interval
        total   (measure, state, group, interval)   share of variance by a group and its interactions with others
        minor   (group)                             1: its interval is from 0 to the joint upper bound of all minor groups
        minor_total (measure, state, interval)      joint share of variance of all minor groups; 0 if there are none
        shapley (measure, state, unit, interval)    Shapley effects, if contributors are correlated; units are the groups
                                                    that there would be without the correlations
        linear  (measure, group)                    by sensitivities of the raw measure at the nominal assembly: (s sigma)^2,
                                                    exact for contributors that are drawn alone
        missed  (measure, state, interval)          share of variance that a prediction by these sensitivities misses
        by_status (status_meaning)                  number of realizations

    `by` is "contributor", "feature" or "part". Contributors that are not independent of each other (correlated, drawn jointly,
    or one determined by another) always form one group. A shared cause is a contributor like others, including its effects on
    the contributors that it drives; these have groups of their own if they also vary on their own. Contributors that do not
    vary are left out.
    With more than 16 groups and 256 samples, a screening of 128 base realizations selects minor groups, which jointly have at
    most 1 % of the variance of any measure; they are estimated as one group (see tolcontact.analyses.contributions).
    `samples` is the number of base realizations: samples (2 + groups) are simulated, and samples (1 + units) more for Shapley
    effects, in addition to the screening. The default follows from 60 000 realizations in total, and is between 512 and 4096.
    `progress` is called with the number of finished realizations and the total. `model`, `seed`, `solver`, `method`, `into`,
    `client` and `minutes` are as in all analyses: `tc.analyses.contributions("model.nc", by="feature")`.
    """
    analysis = Analysis(
        terms.CONTRIBUTIONS, model, samples=MIN_SAMPLES if samples is None else samples, seed=seed, solver=solver,
        method=method, into=into, client=client, progress=progress, minutes=minutes,
    )  # fmt: skip
    program = analysis.program
    deviations = program.draws.without_shared_causes(analysis.sampled_deviations())
    names, varies = owners(program, by), np.ptp(deviations, axis=0) > 0
    groups, units = (independent_groups(program.draws, names, varies, correlated=correlated) for correlated in (True, False))
    analysis.check_varies(groups)
    released = ReleasedDraws(program.draws, units) if len(units) > len(groups) else None
    slopes = total_derivatives(program)
    linear = [_linear_shares(program, deviations, row, groups.values()) for row in slopes]
    labels = {terms.GROUP: list(groups), terms.UNIT: [] if released is None else list(units)}
    return analysis.finest(Shares(analysis, by, groups, released, slopes, linear, labels).answers(samples))


@dataclass(frozen=True, eq=False)
class Shares:
    """Answers of `contributions` from more and more realizations.

    groups    columns of deviations by group
    released  draws for Shapley effects, if any
    slopes    (measure, contributor), at the nominal assembly
    linear    shares (group,) of each measure
    """

    analysis: Analysis
    by: str
    groups: Mapping[str, np.ndarray]
    released: ReleasedDraws | None
    slopes: np.ndarray
    linear: Sequence[np.ndarray]
    labels: Mapping[str, Sequence[str]]

    def answers(self, samples: int | None) -> Iterator[Callable[[], Answer]]:
        """Yield the linear shares without contact, those of the screening, and those of all realizations."""
        analysis, released, groups, seed = self.analysis, self.released, self.groups, self.analysis.seed
        engine = analysis.engine(analysis.samples * _realizations_each(len(groups), released))
        screening, everything = Screening.none(groups), Screening.none(groups)
        yield lambda: self._answer(engine, everything, None, 0, "linear shares, without contact")
        if analysis.samples > 2 * SCREENING_SAMPLES and len(groups) >= MIN_GROUPS:
            run = ScreeningRun(engine, groups, seed)
            for count in run.stages():
                text = f"a screening with {count} base realizations"
                yield partial(self._answer, engine, everything, run.observed, count, text)
            screening = run.screening()
        mixed = MixedDraws(analysis.program.draws, screening.estimated)
        realizations_each = _realizations_each(len(screening.estimated), released)
        if samples is None:
            samples = int(np.clip((BUDGET - engine.simulated) // realizations_each, MIN_SAMPLES, MAX_SAMPLES))
        engine.total = engine.simulated + samples * realizations_each
        observed = Observed(mixed)
        for start, stop in stages(samples, mixed.size):
            observed.simulate(engine, stop - start, seed=seed, start=start)
            if stop > SCREENING_SAMPLES or screening is everything or stop == samples:
                text = f"{stop} of {samples} base realizations"
                yield partial(self._answer, engine, screening, observed, stop, text)
        shapley = _shapley_effects(engine, released, samples, seed)
        yield lambda: self._answer(engine, screening, observed, samples, "", shapley)

    def _answer(
        self, engine: Engine, screening: Screening, observed: Observed | None, count: int, coarse: str,
        shapley: np.ndarray | None = None,
    ) -> Answer:  # fmt: skip
        """Return the answer from `count` base realizations; without any, it has linear shares only."""
        program = self.analysis.program
        if observed is None:
            values = self._unknown()
        else:
            measured, deviations = observed.arrays
            missed_shares = _missed(program, measured[:, 0], deviations, self.slopes)
            values = {**_indices(screening, measured, program.accuracies), "missed": missed_shares}
        if shapley is None:
            shapley = np.full((*self._shape, len(self.labels[terms.UNIT]), len(terms.ESTIMATE)), np.nan)
        values |= {"shapley": shapley, "linear": self.linear, "by_status": engine.statuses}
        attributes = {"base_realizations": count, "realizations": engine.simulated, "by": self.by}
        return Answer(values, self.labels, attributes, coarse)

    @property
    def _shape(self) -> tuple[int, int]:
        return len(self.linear), len(terms.STATES)

    def _unknown(self) -> dict[str, Any]:
        """Return indices that are not known yet."""
        indices = np.full((*self._shape, len(self.groups), len(terms.ESTIMATE)), np.nan)
        minor = np.zeros(len(self.groups), dtype=np.int8)
        of_all = np.full((*self._shape, len(terms.ESTIMATE)), np.nan)
        return {"first": indices, "total": indices, "minor": minor, "minor_total": of_all, "missed": of_all}


def _missed(program: Program, measured: np.ndarray, deviations: np.ndarray, slopes: np.ndarray) -> list[Any]:
    """Return the shares (measure, state, interval) of variance that linear predictions miss."""
    own = program.draws.without_shared_causes(deviations)
    return [
        [missed(f, own @ row, accuracy) for f in states]
        for states, row, accuracy in zip(measured.transpose(2, 1, 0), slopes, program.accuracies, strict=True)
    ]


def _realizations_each(groups: int, released: ReleasedDraws | None) -> int:
    """Return the realizations per base realization for Sobol' indices of groups, and for Shapley effects if any."""
    return 2 + groups + (0 if released is None else released.size)


def _indices(screening: Screening, measured: np.ndarray, accuracies: np.ndarray) -> dict[str, Any]:
    """Return the variables of Sobol' indices, from measures (base, realization, state, measure) of a design."""
    indices = [
        [screening.of_all_groups(sobol_indices(f, accuracy), measure, state) for state, f in enumerate(states)]
        for measure, (states, accuracy) in enumerate(zip(measured.transpose(3, 2, 0, 1), accuracies, strict=True))
    ]
    names = "first", "total", "minor_total"
    columns = {name: [[row[k] for row in states] for states in indices] for k, name in enumerate(names)}
    return {**columns, "minor": screening.is_minor.astype(np.int8)}


def _shapley_effects(engine: Engine, released: ReleasedDraws | None, samples: int, seed: int) -> np.ndarray:
    """Return Shapley effects (measure, state, unit, interval); there are no units if nothing is correlated."""
    if released is None:
        return np.empty((len(engine.program.nominal.measures), len(terms.STATES), 0, len(terms.ESTIMATE)))
    measured, _ = engine.simulate_design(released, samples, seed=seed)
    positions = released.positions(seed, 0, samples)
    return np.array([
        [shapley_effects(f, positions, accuracy) for f in states]
        for states, accuracy in zip(measured.transpose(3, 2, 0, 1), engine.program.accuracies, strict=True)
    ])  # fmt: skip


def _linear_shares(program: Program, deviations: np.ndarray, slopes: np.ndarray, groups: Any) -> np.ndarray:
    """Return the share (group,) of each group in the variance of a linear measure with slopes (contributor,).

    The variance of a group is exact for a single contributor that is drawn alone; otherwise it is estimated from own deviations
    (n, contributor).
    """
    draws = program.draws
    together = {column for columns in draws.dependent() for column in columns}
    alone = {k for k, label in enumerate(draws.labels) if label in draws.varying and k not in together}

    def variance(columns: np.ndarray) -> float:
        if len(columns) == 1 and int(columns[0]) in alone:
            return float(slopes[columns[0]] ** 2 * draws.contributors[int(columns[0])].variance)
        return float((deviations[:, columns] @ slopes[columns]).var())

    variances = np.array([variance(columns) for columns in groups])
    return variances / variances.sum() if variances.sum() > 0 else np.full(len(variances), np.nan)


def _first_deviations(size: int, block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the measures, the deviations of the first of every `size` realizations, and the statuses of a block."""
    deviations = block.deviations[-block.start % size :: size]
    return block.measured.copy(), deviations.copy(), block.status.copy()
