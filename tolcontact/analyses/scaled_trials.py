"""Simulations with scaled tolerance ranges, and realizations where required measures change, by group of tolerances.

A group without effect near its present range may still be decisive once it is wider, or once others are narrower. So it counts
as idle only if no resolved realization of a run changes at its smallest and at its largest range. All groups that may be idle
are scaled at the same time: while nothing changes, all of them are idle, and the run costs as much as for one group. At the
largest ranges of influential groups many realizations are slow; so blocks of realizations grow, and each block is searched for
such groups before the next.
"""

import bisect
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import VERIFICATION_FACTOR, Engine
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.limits import Limits
from tolcontact.statistics.capability import by_percentiles, share_outside, without_stops
from tolcontact.statistics.intervals import Estimate, mean, proportion_of
from tolcontact.statistics.measure_statistics import VALUE, StatisticRequest
from tolcontact.statistics.sample import Sample
from tolcontact.variation import Draws
from tolcontact.vocabulary import PPK, PPM

TAIL = 0.00135
ROUNDING = 1e-9
MIN_DECISIVE, DECISIVE = 128, 8  # values that determine a margin: at least, and in multiples of the values beyond it
SPREAD = 4.0  # of the shares whose quantiles are averaged for slopes: a single quantile rests on too few realizations
MIN_HITS = 10  # realizations outside the limits needed to estimate a share
EXAMPLES = ("corner height: ppm 1000", "gap: Ppk 1.33")
STEP = 0.1  # of ranges, for differences
FIRST_TRIALS = 64  # realizations that show whether most are unresolved
MAX_ROWS = 1 << 16  # realizations per simulation, over several factors
NEGLIGIBLE = 1e-6  # of a measure's spread: smaller changes count as 0
FIRST_BLOCK = 64  # realizations; each further block has as many as all previous ones
MAX_HITS = 8  # changed realizations that are used to identify the groups
BATCHES = 32  # of realizations, for the intervals of effects
# Realizations for the effect of a group: at least this number; at most samples / 4, and 4 samples / groups.
MIN_EFFECT_SAMPLES, EFFECT_SHARE = 512, 4


@dataclass(frozen=True)
class Requirement:
    """A largest share of a corrected measure outside its limits, or a smallest Ppk.

    name      the text of the user
    measure   index of the measure
    is_share  whether `value` is a share (of 1); otherwise it is a Ppk
    """

    name: str
    measure: int
    limits: Limits
    is_share: bool
    value: float

    @classmethod
    def parse(cls, text: str, program: Program) -> "Requirement":
        """Return the requirement "corner height: ppm 1000" or "corner height: Ppk 1.33". Raises OptionError for others."""
        request = StatisticRequest.parse(text, "require", statistics=(PPM, PPK), form=VALUE, examples=EXAMPLES)
        measures = program.nominal.measures
        number = request.number_of([measure.name for measure in measures])
        limits = program.limits(number)
        if limits.are_open:
            raise OptionError(f'require names "{request.measure}", which has no limits; give it tolerance=... or limits=...')
        is_share = request.statistic == PPM
        return cls(text.strip(), number, limits, is_share, request.value * (1e-6 if is_share else 1))

    @property
    def share(self) -> float:
        """The permitted share of values beyond the limits; for a Ppk, the share beyond its percentiles."""
        return self.value if self.is_share else TAIL

    def check(self, samples: int) -> None:
        """Raise OptionError if `samples` are too few to estimate the share or the Ppk."""
        minimum = int(np.ceil(MIN_HITS / self.share * (1 - ROUNDING)))
        if samples < minimum:
            raise OptionError(f'{samples} realizations are too few for "{self.name}"; expected samples={minimum} or more')

    def margin(self, x: np.ndarray) -> float:
        """Return the margin of values (n,) above the requirement, in the measure's units; negative if they do not meet it.

        For a share the margin is a quantile of the distances within the limits. It changes continuously with the values,
        while a count of values outside jumps. Limits that are stops need no margin (see without_stops).
        """
        return self._share_margin(x, self.value) if self.is_share else self._capability_margin(x, self.value)

    def smooth_margin(self, x: np.ndarray) -> float:
        """Return the margin with the means of quantiles around the quantiles of `margin`, for slopes."""
        spread = min(SPREAD, self.share**-0.5)
        shares = self.share * np.geomspace(1 / spread, spread, 16)
        return self._share_margin(x, shares) if self.is_share else self._capability_margin(x, self.value, shares)

    def sure_margin(self, x: np.ndarray) -> float:
        """Return the margin of the 95 % interval of the share, or of the Ppk: 0 or more if it keeps the requirement.

        x   (n,) values of a fresh run
        """
        if self.is_share:
            counts = range(len(x) + 1)
            permitted = bisect.bisect_right(counts, self.value, key=lambda hits: proportion_of(hits, len(x)).upper) - 1
            return self._share_margin(x, permitted / len(x)) if permitted >= 0 else -math.inf
        value, lower, _ = self.estimate(x)
        return self._capability_margin(x, self.value + value - lower) if lower > 0 else -math.inf

    def _share_margin(self, x: np.ndarray, shares: float | np.ndarray) -> float:
        return -float(np.quantile(without_stops(Sample.of(x), self.limits).excess(x), 1 - shares).mean())

    def _capability_margin(self, x: np.ndarray, index: float, shares: float | np.ndarray = TAIL) -> float:
        lower, upper, _ = without_stops(Sample.of(x), self.limits)
        tail, middle, head = np.quantile(x, shares).mean(), np.median(x), np.quantile(x, 1 - shares).mean()
        return float(np.nanmin([upper - middle - index * (head - middle), middle - lower - index * (middle - tail)]))

    def decisive(self, x: np.ndarray) -> np.ndarray:
        """Return the indices of the values (n,) that determine the margin: values beyond it, and values near it.

        The median of a Ppk is treated as constant.
        """
        count = max(math.ceil(DECISIVE * self.share * len(x)), MIN_DECISIVE)
        limits = without_stops(Sample.of(x), self.limits)
        orders = [np.argsort(-limits.excess(x))] if self.is_share else [np.argsort(x), np.argsort(-x)]
        return np.concatenate([order[:count] for order in orders])

    def shortfall(self, x: np.ndarray) -> float:
        """Return the shortfall of the bound of values (n,) as a share of the required value; 0 if it meets the requirement."""
        _, lower, upper = self.estimate(x)
        missing = upper - self.value if self.is_share else self.value - lower
        return max(missing / self.value, 0.0) if np.isfinite(missing) else np.inf

    def estimate(self, x: np.ndarray) -> Estimate:
        """Return the share outside, or the Ppk, of values (n,), with its 95 % interval."""
        sample = Sample.of(x)
        if self.is_share:
            return share_outside(sample, self.limits)
        return by_percentiles(sample, self.limits)[1]


def requirements_of(require: str | Sequence[str], program: Program, samples: int) -> list[Requirement]:
    """Return the requirements that texts state. Raises OptionError if there are none, or for too few samples."""
    requirements = [Requirement.parse(text, program) for text in ([require] if isinstance(require, str) else require)]
    if not requirements:
        raise OptionError('require is empty; expected a text such as "corner height: ppm 1000"')
    for requirement in requirements:
        requirement.check(samples)
    return requirements


Hits = tuple[np.ndarray, np.ndarray]  # numbers (row,) of realizations that change, and their corrected measures afterwards


class Trial(NamedTuple):
    """Realizations with scaled ranges. Poses of unresolved realizations are arbitrary, and so are their measures.

    logs         (group,): logarithms of the factors of the ranges
    corrected    (n, measure): corrected measures
    is_resolved  (n,)
    """

    logs: np.ndarray
    corrected: np.ndarray
    is_resolved: np.ndarray


@dataclass(frozen=True, eq=False)
class ScaledTrials:
    """Simulations with scaled ranges, on the same draws. Logarithms of the factors of the ranges are `logs` (group,).

    groups  columns of each group
    """

    engine: Engine
    groups: Sequence[np.ndarray]
    requirements: Sequence[Requirement]
    seed: int
    samples: int
    _known: dict[str, np.ndarray] = field(default_factory=dict, init=False)

    def trial(self, logs: np.ndarray, *, verification: int = 0) -> Trial:
        """Return the trial; a `verification` above 0 is the number of a run with other draws, and more of them."""
        count = VERIFICATION_FACTOR * self.samples if verification else self.samples
        measured, status = self.engine.simulate(count, start=verification << 32, seed=self.seed, draws=self._draws(logs))
        return Trial(logs, np.ascontiguousarray(measured[:, terms.CORRECTED]), ~np.isin(status, terms.UNRESOLVED))

    def trial_within(self, logs: np.ndarray, most_unresolved: int) -> Trial | None:
        """Return the trial, or None if too many realizations are unresolved.

        It stops once there are more than `most_unresolved`, since these take a hundred times as long as others.
        """
        draws, corrected, resolved, start = self._draws(logs), [], [], 0
        while start < self.samples:
            stop = min(max(2 * start, FIRST_TRIALS), self.samples)
            measured, status = self.engine.simulate(stop - start, start=start, seed=self.seed, draws=draws)
            corrected.append(measured[:, terms.CORRECTED])
            resolved.append(~np.isin(status, terms.UNRESOLVED))
            if sum(int((~part).sum()) for part in resolved) > most_unresolved:
                return None
            start = stop
        return Trial(logs, np.concatenate(corrected), np.concatenate(resolved))

    def corrected_rows(self, trials: Sequence[np.ndarray], rows: np.ndarray) -> list[np.ndarray]:
        """Return corrected measures (row, measure) of realizations by their numbers, for the `logs` of several trials."""
        if not len(rows):
            return [np.empty((0, len(self.engine.program.nominal.measures)))] * len(trials)
        corrected, at_once = [], max(MAX_ROWS // len(rows), 1)
        for start in range(0, len(trials), at_once):
            deviations = [
                self._draws(logs).from_numbers(lambda label: self._numbers(label)[rows], len(rows))
                for logs in trials[start : start + at_once]
            ]
            measured, _ = self.engine.simulate_deviations(np.concatenate(deviations))
            corrected += np.split(measured[:, terms.CORRECTED], len(deviations))
        return corrected

    def _numbers(self, label: str) -> np.ndarray:
        """Return the random numbers (n,) between 0 and 1 for the deviations of a label, in all realizations."""
        if label not in self._known:
            self._known[label] = self.engine.program.draws.numbers(seed=self.seed, start=0, stop=self.samples)(label)
        return self._known[label]

    def _draws(self, logs: np.ndarray) -> Draws:
        program = self.engine.program
        scale = np.ones(len(program.nominal.contributors))
        for log, columns in zip(logs, self.groups, strict=True):
            scale[columns] = np.exp(log)
        return program.draws.scaled(scale)

    def changes(self, before: Trial, sets: Iterable[Any], rows: np.ndarray, logs: np.ndarray) -> list[Hits]:
        """Return the rows, out of resolved `rows` (row,) of a trial, whose required measures change with other ranges.

        sets   for each of the results, the group or the groups (k,) that change to `logs` at the same time
        """
        changed = [np.where(np.isin(np.arange(len(logs)), groups), logs, before.logs) for groups in sets]
        measures = sorted({requirement.measure for requirement in self.requirements})
        resolved = before.corrected[before.is_resolved][:, measures]
        spreads = resolved.std(axis=0) if len(resolved) else np.zeros(len(measures))
        hits = []
        for corrected in self.corrected_rows(changed, rows):
            differences = np.abs(corrected - before.corrected[rows])[:, measures]
            is_hit = ~(differences <= NEGLIGIBLE * spreads).all(axis=1)
            hits.append((rows[is_hit], corrected[is_hit]))
        return hits

    def idle(self, before: Trial, candidates: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
        """Return the candidates (group,) bool that jointly change no realization, with their ranges times either of `ends`.

        Other groups keep their ranges. If none of n realizations changes, the share of changing realizations is at most 3 / n,
        with 95 % confidence; requirements need n of at least ten times the inverse of the share that they allow.
        """
        idle = candidates.copy()
        for end in reversed(ends):
            while self._release(before, idle, np.full(len(candidates), np.log(end))):
                pass  # only a last run over all blocks shows that the remaining groups change nothing
        return idle

    def _release(self, before: Trial, idle: np.ndarray, logs: np.ndarray) -> bool:
        """Mark idle groups (group,) that change a realization as not idle; return whether there are any."""
        resolved_rows, number, start = np.flatnonzero(before.is_resolved), idle.sum(), 0
        while start < len(resolved_rows) and idle.any():
            stop = min(max(2 * start, FIRST_BLOCK), len(resolved_rows))
            rows = resolved_rows[start:stop]
            while idle.any() and len(rows := self.changes(before, [np.flatnonzero(idle)], rows, logs)[0][0]):
                groups = np.flatnonzero(idle)
                is_hit = [len(hits) > 0 for hits, _ in self.changes(before, groups, rows[:MAX_HITS], logs)]
                # Groups that change realizations only jointly are all influential.
                idle[groups[is_hit] if any(is_hit) else groups] = False
            start = stop
        return bool(idle.sum() < number)


def effect_samples(samples: int, groups: int) -> int:
    """Return the number of realizations, out of `samples`, for the effect of each group."""
    count = min(samples // EFFECT_SHARE, EFFECT_SHARE * samples // max(groups, 1))
    return min(max(count, MIN_EFFECT_SAMPLES), samples)


def narrowing_effects(trials: ScaledTrials) -> np.ndarray:
    """Return changes (measure, of_effect, group, interval) if a group's zones were a tenth narrower.

    Intervals come from means over batches of the same draws. A group that changes none of the first realizations has no effect.
    """
    program = trials.engine.program
    limits = [program.limits(number) for number in range(len(program.nominal.measures))]
    count = len(trials.groups)
    rows = np.arange(effect_samples(trials.samples, count))
    present, *narrowed_groups = trials.corrected_rows(list(np.log1p(-STEP * np.eye(1 + count, count, -1))), rows)
    effects = np.zeros((len(limits), len(terms.EFFECTS), count, len(terms.ESTIMATE)))
    for group, narrowed in enumerate(narrowed_groups):
        if (np.abs(narrowed - present)[:MIN_DECISIVE].max(axis=0) <= NEGLIGIBLE * present.std(axis=0)).all():
            continue
        for measure, limits_of_measure in enumerate(limits):
            batches = [np.array_split(values[:, measure], BATCHES) for values in (narrowed, present)]
            spreads = [np.array([6 * x.std(ddof=1) for x in values]) for values in batches]
            shares = [np.array([limits_of_measure.outside(x).mean() for x in values]) for values in batches]
            effects[measure, 0, group] = mean(spreads[0] - spreads[1])
            effects[measure, 1, group] = mean(shares[0] - shares[1])
    return effects
