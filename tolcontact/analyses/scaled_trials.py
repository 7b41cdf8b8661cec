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
from tolcontact.analyses.analysis import VERIFICATION_FACTOR, Analysis, stages
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

    def margin(
        self, corrected: np.ndarray, shares: float | np.ndarray | None = None, index: float | None = None
    ) -> float:  # fmt: skip
        """Return the margin of measures (n, measure) above the requirement, in the measure's units; negative if they miss it.

        For a share the margin is a quantile of the distances within the limits. It changes continuously with the values,
        while a count of values outside jumps. Limits that are stops need no margin (see without_stops).
        `shares`, whose quantiles are averaged, and the `index` replace those of the requirement.
        """
        x, shares = corrected[:, self.measure], self.share if shares is None else shares
        limits = without_stops(Sample.of(x), self.limits)
        if self.is_share:
            return -float(np.quantile(limits.excess(x), 1 - shares).mean())
        index = self.value if index is None else index
        tail, middle, head = np.quantile(x, shares).mean(), np.median(x), np.quantile(x, 1 - shares).mean()
        sides = limits.upper - middle - index * (head - middle), middle - limits.lower - index * (middle - tail)
        return float(np.nanmin(sides))

    def smooth_margin(self, corrected: np.ndarray) -> float:
        """Return the margin with the means of quantiles around the quantiles of `margin`, for slopes."""
        spread = min(SPREAD, self.share**-0.5)
        return self.margin(corrected, self.share * np.geomspace(1 / spread, spread, 16))

    def sure_margin(self, corrected: np.ndarray) -> float:
        """Return the margin of the 95 % interval of the share or the Ppk: 0 or more if a fresh run keeps the requirement."""
        if self.is_share:
            count = len(corrected)
            hits = bisect.bisect_right(range(count + 1), self.value, key=lambda hits: proportion_of(hits, count).upper) - 1
            return self.margin(corrected, hits / count) if hits >= 0 else -math.inf
        value, lower, _ = self.estimate(corrected)
        return self.margin(corrected, index=self.value + value - lower) if lower > 0 else -math.inf

    def decisive(self, corrected: np.ndarray) -> np.ndarray:
        """Return the indices of the realizations that determine the margin: values beyond it, and values near it.

        The median of a Ppk is treated as constant.
        """
        x = corrected[:, self.measure]
        count = max(math.ceil(DECISIVE * self.share * len(x)), MIN_DECISIVE)
        keys = [-without_stops(Sample.of(x), self.limits).excess(x)] if self.is_share else [x, -x]
        return np.concatenate([np.argsort(key)[:count] for key in keys])

    def shortfall(self, corrected: np.ndarray) -> float:
        """Return the shortfall of the bound of an estimate as a share of the required value; 0 if it meets the requirement."""
        _, lower, upper = self.estimate(corrected)
        missing = upper - self.value if self.is_share else self.value - lower
        return max(missing / self.value, 0.0) if np.isfinite(missing) else np.inf

    def estimate(self, corrected: np.ndarray) -> Estimate:
        """Return the share outside, or the Ppk, with its 95 % interval."""
        sample = Sample.of(corrected[:, self.measure])
        return share_outside(sample, self.limits) if self.is_share else by_percentiles(sample, self.limits)[1]


def requirements_of(require: str | Sequence[str], program: Program, samples: int) -> list[Requirement]:
    """Return the requirements that texts state. Raises OptionError if there are none, or for too few samples."""
    requirements = [Requirement.parse(text, program) for text in ([require] if isinstance(require, str) else require)]
    if not requirements:
        raise OptionError('require is empty; expected a text such as "corner height: ppm 1000"')
    for requirement in requirements:
        minimum = int(np.ceil(MIN_HITS / requirement.share * (1 - ROUNDING)))
        if samples < minimum:
            raise OptionError(
                f'{samples} realizations are too few for "{requirement.name}"; expected samples={minimum} or more'
            )
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

    analysis: Analysis
    groups: Sequence[np.ndarray]
    requirements: Sequence[Requirement]
    _known: dict[str, np.ndarray] = field(default_factory=dict, init=False)

    def trial(self, logs: np.ndarray, *, verification: int = 0) -> Trial:
        """Return the trial; a `verification` above 0 is the number of a run with other draws, and more of them."""
        count = VERIFICATION_FACTOR * self.analysis.samples if verification else self.analysis.samples
        return self._trial(logs, count, verification << 32)

    def trial_within(self, logs: np.ndarray, most_unresolved: int) -> Trial | None:
        """Return the trial, or None if too many realizations are unresolved.

        It stops once there are more than `most_unresolved`, since these take a hundred times as long as others.
        """
        parts: list[Trial] = []
        for start, stop in stages(self.analysis.samples, 1, first=FIRST_BLOCK):
            parts.append(self._trial(logs, stop - start, start))
            if sum(int((~part.is_resolved).sum()) for part in parts) > most_unresolved:
                return None
        _, corrected, is_resolved = zip(*parts, strict=True)
        return Trial(logs, np.concatenate(corrected), np.concatenate(is_resolved))

    def _trial(self, logs: np.ndarray, count: int, start: int) -> Trial:
        measured, status = self.analysis.simulate(count, start=start, draws=self._draws(logs))
        return Trial(logs, np.ascontiguousarray(measured[:, terms.CORRECTED]), ~np.isin(status, terms.UNRESOLVED))

    def corrected_rows(self, trials: Sequence[np.ndarray], rows: np.ndarray) -> list[np.ndarray]:
        """Return corrected measures (row, measure) of realizations by their numbers, for the `logs` of several trials."""
        if not len(rows):
            return [np.empty((0, len(self.analysis.program.nominal.measures)))] * len(trials)
        corrected, at_once = [], max(MAX_ROWS // len(rows), 1)
        for start in range(0, len(trials), at_once):
            deviations = [
                self._draws(logs).from_numbers(lambda label: self._numbers(label)[rows], len(rows))
                for logs in trials[start : start + at_once]
            ]
            measured, _ = self.analysis.simulate_deviations(np.concatenate(deviations))
            corrected += np.split(measured[:, terms.CORRECTED], len(deviations))
        return corrected

    def _numbers(self, label: str) -> np.ndarray:
        """Return the random numbers (n,) between 0 and 1 for the deviations of a label, in all realizations."""
        if label not in self._known:
            draws = self.analysis.program.draws
            self._known[label] = draws.numbers(seed=self.analysis.seed, start=0, stop=self.analysis.samples)(label)
        return self._known[label]

    def _draws(self, logs: np.ndarray) -> Draws:
        scale = np.ones(len(self.analysis.program.nominal.contributors))
        for log, columns in zip(logs, self.groups, strict=True):
            scale[columns] = np.exp(log)
        return self.analysis.program.draws.scaled(scale)

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
        resolved_rows, number = np.flatnonzero(before.is_resolved), idle.sum()
        for start, stop in stages(len(resolved_rows), 1, first=FIRST_BLOCK):
            rows = resolved_rows[start:stop]
            while idle.any() and len(rows := self.changes(before, [np.flatnonzero(idle)], rows, logs)[0][0]):
                groups = np.flatnonzero(idle)
                is_hit = [len(hits) > 0 for hits, _ in self.changes(before, groups, rows[:MAX_HITS], logs)]
                # Groups that change realizations only jointly are all influential.
                idle[groups[is_hit] if any(is_hit) else groups] = False
        return bool(idle.sum() < number)


def effect_samples(samples: int, groups: int) -> int:
    """Return the number of realizations, out of `samples`, for the effect of each group."""
    count = min(samples // EFFECT_SHARE, EFFECT_SHARE * samples // max(groups, 1))
    return min(max(count, MIN_EFFECT_SAMPLES), samples)


def narrowing_effects(trials: ScaledTrials) -> np.ndarray:
    """Return changes (measure, of_effect, group, interval) if a group's zones were a tenth narrower.

    Intervals come from means over batches of the same draws. A group that changes none of the first realizations has no effect.
    """
    program = trials.analysis.program
    limits = [program.limits(number) for number in range(len(program.nominal.measures))]
    count = len(trials.groups)
    rows = np.arange(effect_samples(trials.analysis.samples, count))
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
