"""Simulations with scaled tolerance ranges, and realizations where required measures change, by group of tolerances.

A group without effect near its present range may still be decisive once it is wider, or once others are narrower. So it counts
as idle only if no resolved realization of a run changes at its smallest and at its largest range. All groups that may be idle
are scaled at the same time: while nothing changes, all of them are idle, and the run costs as much as for one group. At the
largest ranges of influential groups many realizations are slow; so blocks of realizations grow, and each block is searched for
such groups before the next.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import VERIFICATION_FACTOR, Analysis, stages
from tolcontact.analyses.costs import Curve
from tolcontact.analyses.requirements import MIN_DECISIVE, Corrected, Requirement
from tolcontact.limits import Limits
from tolcontact.statistics.intervals import mean
from tolcontact.statistics.measure_statistics import MIN_VALUES
from tolcontact.variation import Draws

STEP = 0.1  # of ranges, for differences
MAX_ROWS = 1 << 16  # realizations per simulation, over several factors
NEGLIGIBLE = 1e-6  # of a measure's spread: smaller changes count as 0
FIRST_BLOCK = 64  # realizations; each further block has as many as all previous ones
MAX_HITS = 8  # changed realizations that are used to identify the groups
BATCHES = 32  # of realizations, for the intervals of effects
# Realizations for the effect of a group: at least this number; at most samples / 4, and 4 samples / groups.
MIN_EFFECT_SAMPLES, EFFECT_SHARE = 512, 4


Hits = tuple[np.ndarray, Corrected]  # numbers (row,) of realizations that change, and their corrected measures afterwards


class Trial(NamedTuple):
    """Realizations with scaled ranges; `logs` (group,) are the logarithms of the factors of the ranges."""

    logs: np.ndarray
    corrected: Corrected

    @property
    def is_resolved(self) -> np.ndarray:
        """Whether each realization is resolved, (n,)."""
        return self.corrected.is_resolved


@dataclass(frozen=True, eq=False)
class ScaledTrials:
    """Simulations with scaled ranges, on the same draws. Logarithms of the factors of the ranges are `logs` (group,).

    groups  columns of each group
    curves  of each group: how the middles of sizes move with their ranges; none if all stay
    """

    analysis: Analysis
    groups: Sequence[np.ndarray]
    requirements: Sequence[Requirement]
    curves: Sequence[Curve] = ()
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
        return Trial(logs, Corrected.joined([part.corrected for part in parts]))

    def _trial(self, logs: np.ndarray, count: int, start: int) -> Trial:
        measured, status = self.analysis.simulate(count, start=start, draws=self._draws(logs))
        return Trial(logs, Corrected(np.ascontiguousarray(measured[:, terms.CORRECTED]), status))

    def corrected_rows(self, trials: Sequence[np.ndarray], rows: np.ndarray) -> list[Corrected]:
        """Return corrected measures of realizations by their numbers `rows` (row,), for the `logs` of several trials."""
        if not len(rows):
            return [Corrected(np.empty((0, len(self.analysis.program.nominal.measures))), np.empty(0, dtype=int))] * len(trials)
        corrected, at_once = list[Corrected](), max(MAX_ROWS // len(rows), 1)
        for start in range(0, len(trials), at_once):
            deviations = [
                self._draws(logs).from_numbers(lambda label: self._numbers(label)[rows], len(rows))
                for logs in trials[start : start + at_once]
            ]
            measured, status = self.analysis.simulate_deviations(np.concatenate(deviations))
            pairs = zip(*(np.split(array, len(deviations)) for array in (measured[:, terms.CORRECTED], status)), strict=True)
            corrected += [Corrected(*pair) for pair in pairs]
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
        shifts = np.zeros(len(scale))
        for log, curve in zip(logs, self.curves, strict=False):
            shifts[curve.sizes] = curve.shift(log)
        return self.analysis.program.draws.scaled(scale, shifts)

    def changes(self, before: Trial, sets: Iterable[Any], rows: np.ndarray, logs: np.ndarray) -> list[Hits]:
        """Return the rows, out of resolved `rows` (row,) of a trial, that change with other ranges.

        Their required measures change, or they cannot be assembled any more.

        sets   for each of the results, the group or the groups (k,) that change to `logs` at the same time
        """
        changed = [np.where(np.isin(np.arange(len(logs)), groups), logs, before.logs) for groups in sets]
        measures = sorted({requirement.measure for requirement in self.requirements})
        resolved = before.corrected.values[before.is_resolved][:, measures]
        spreads = resolved.std(axis=0) if len(resolved) else np.zeros(len(measures))
        hits = []
        for corrected in self.corrected_rows(changed, rows):
            differences = np.abs(corrected.values - before.corrected.values[rows])[:, measures]
            is_hit = ~((differences <= NEGLIGIBLE * spreads).all(axis=1) & corrected.is_assembled)
            hits.append((rows[is_hit], corrected.take(is_hit)))
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
        first = (narrowed.values - present.values)[:MIN_DECISIVE]
        is_same = (narrowed.is_assembled == present.is_assembled)[:MIN_DECISIVE].all()
        if is_same and (np.abs(first).max(axis=0) <= NEGLIGIBLE * present.values.std(axis=0)).all():
            continue
        for measure, limits_of_measure in enumerate(limits):
            spreads, shares = zip(*(_batches(x, measure, limits_of_measure) for x in (narrowed, present)), strict=True)
            effects[measure, 0, group] = mean(spreads[0] - spreads[1])
            effects[measure, 1, group] = mean(shares[0] - shares[1])
    return effects


def _batches(corrected: Corrected, measure: int, limits: Limits) -> tuple[np.ndarray, np.ndarray]:
    """Return 6 sigma and the share outside limits (batch,) of a measure in batches of realizations."""
    batches = [corrected.take(rows) for rows in np.array_split(np.arange(corrected.count), BATCHES)]
    values = [batch.existing(measure) for batch in batches]
    spreads = [6 * x.std(ddof=1) if len(x) >= MIN_VALUES else np.nan for x in values]
    shares = [limits.outside(batch.values[:, measure]) | ~batch.is_assembled for batch in batches]
    return np.array(spreads), np.array([share.mean() for share in shares])
