"""Simulations with scaled tolerance ranges, and realizations where required measures change, by group of tolerances.

Most groups affect few realizations. The ranges of these groups are changed all at once; only where a realization changes, the
set of groups is bisected. So most groups cost almost nothing.

A group without effect near its present range may still be decisive once it is wider, or once others are narrower. So it counts
as idle only if no resolved realization of a run changes at its smallest and at its largest range. All groups that may be idle
are scaled at the same time: while nothing changes, all of them are idle, and the run costs as much as for one group. At the
largest ranges of influential groups many realizations are slow; so blocks of realizations grow, and each block is searched for
such groups before the next.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import VERIFICATION_FACTOR, Engine
from tolcontact.analyses.requirement import MIN_DECISIVE
from tolcontact.statistics.intervals import mean
from tolcontact.variation import Draws

STEP = 0.1  # of ranges, for differences
FIRST_TRIALS = 64  # realizations that show whether most are unresolved
MAX_ROWS = 1 << 16  # realizations per simulation, over several factors
NEGLIGIBLE = 1e-6  # of a measure's spread: smaller changes count as 0
FIRST_ROWS = 32  # realizations for finding the groups that affect many
FIRST_BLOCK = 64  # realizations; each further block has as many as all previous ones
MAX_HITS = 8  # changed realizations that are used to identify the groups
BATCHES = 32  # of realizations, for the intervals of effects
# Realizations for the effect of a group: at least this number; at most samples / 4, and 4 samples / groups.
MIN_EFFECT_SAMPLES, EFFECT_SHARE = 512, 4


class Trial(NamedTuple):
    """Corrected measures (n, measure) of realizations, and whether each is resolved (n,).

    Poses of unresolved realizations are arbitrary, and so are their measures.
    """

    corrected: np.ndarray
    is_resolved: np.ndarray


@dataclass(frozen=True, eq=False)
class ScaledTrials:
    """Simulations with scaled ranges, on the same draws.

    groups  columns of each group
    """

    engine: Engine
    groups: Sequence[np.ndarray]
    seed: int
    samples: int
    _known: dict[str, np.ndarray] = field(default_factory=dict, init=False)

    def trial(self, factors: np.ndarray, *, verification: int = 0) -> Trial:
        """Return the trial with the groups' ranges times factors (group,).

        A `verification` above 0 is the number of a run with other draws, and more of them.
        """
        count = VERIFICATION_FACTOR * self.samples if verification else self.samples
        measured, status = self.engine.simulate(count, start=verification << 32, seed=self.seed, draws=self._draws(factors))
        return Trial(np.ascontiguousarray(measured[:, terms.CORRECTED]), ~np.isin(status, terms.UNRESOLVED))

    def trial_within(self, factors: np.ndarray, most_unresolved: int) -> Trial | None:
        """Return the trial with the groups' ranges times factors (group,), or None if too many realizations are unresolved.

        It stops once there are more than `most_unresolved`, since these take a hundred times as long as others.
        """
        draws, parts, unresolved, start = self._draws(factors), [], 0, 0
        while start < self.samples:
            stop = min(max(2 * start, FIRST_TRIALS), self.samples)
            measured, status = self.engine.simulate(stop - start, start=start, seed=self.seed, draws=draws)
            parts.append(Trial(measured[:, terms.CORRECTED], ~np.isin(status, terms.UNRESOLVED)))
            unresolved += int((~parts[-1].is_resolved).sum())
            if unresolved > most_unresolved:
                return None
            start = stop
        return Trial(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def corrected_rows(self, factors: Sequence[np.ndarray], rows: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return corrected measures (row, measure) of selected realizations, for each of several factors (group,).

        rows  numbers (row,) of the realizations for each of the factors
        """
        corrected: list[np.ndarray] = []
        while len(corrected) < len(rows):
            start, counts = len(corrected), np.cumsum([len(numbers) for numbers in rows[len(corrected) :]])
            stop = start + max(int(np.searchsorted(counts, MAX_ROWS, side="right")), 1)
            deviations = [self._deviations(*trial) for trial in zip(factors[start:stop], rows[start:stop], strict=True)]
            corrected += np.split(self._corrected(np.concatenate(deviations)), counts[: stop - start - 1])
        return corrected

    def _corrected(self, deviations: np.ndarray) -> np.ndarray:
        """Return corrected measures (n, measure) of deviations (n, contributor); n may be 0."""
        if not len(deviations):
            return np.empty((0, len(self.engine.program.nominal.measures)))
        return self.engine.simulate_deviations(deviations)[0][:, terms.CORRECTED]

    def _deviations(self, factors: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return the deviations (row, contributor) of the realizations with numbers `rows` (row,)."""
        return self._draws(factors).from_numbers(lambda label: self._numbers(label)[rows], len(rows))

    def _numbers(self, label: str) -> np.ndarray:
        """Return the random numbers (n,) between 0 and 1 for the deviations of a label, in all realizations."""
        if label not in self._known:
            self._known[label] = self.engine.program.draws.numbers(seed=self.seed, start=0, stop=self.samples)(label)
        return self._known[label]

    def _draws(self, factors: np.ndarray) -> Draws:
        program = self.engine.program
        scale = np.ones(len(program.nominal.contributors))
        for factor, columns in zip(factors, self.groups, strict=True):
            scale[columns] = factor
        return program.draws.scaled(scale)

    def __len__(self) -> int:
        return len(self.groups)


class Hits(NamedTuple):
    """Realizations that change: their numbers (row,), and their corrected measures (row, measure) after the change."""

    rows: np.ndarray
    corrected: np.ndarray


@dataclass(frozen=True, eq=False)
class ChangedRows:
    """The search for realizations that change.

    measures  indices of the required measures
    logs      (group,) logarithms of the factors of the ranges before the change
    before    the trial there; only its resolved realizations may be requested
    """

    trials: ScaledTrials
    measures: Sequence[int]
    logs: np.ndarray
    before: Trial

    @cached_property
    def resolved_rows(self) -> np.ndarray:
        """The numbers of the realizations (row,) that are resolved before the change."""
        return np.flatnonzero(self.before.is_resolved)

    def of_sets(self, sets: Sequence[tuple[np.ndarray, np.ndarray]], changed_logs: np.ndarray) -> list[Hits]:
        """Return the rows that each set of groups changes if the logarithms of its factors become `changed_logs` (group,).

        sets  groups (k,) that change at the same time, and the rows (row,) to check
        """
        factors = [np.exp(np.where(np.isin(np.arange(len(self.logs)), groups), changed_logs, self.logs)) for groups, _ in sets]
        rows_of_sets = [rows for _, rows in sets]
        resolved = self.before.corrected[self.resolved_rows][:, self.measures]
        spreads = resolved.std(axis=0) if len(resolved) else np.zeros(len(self.measures))
        hits = []
        for rows, corrected in zip(rows_of_sets, self.trials.corrected_rows(factors, rows_of_sets), strict=True):
            changes = np.abs(corrected - self.before.corrected[rows])[:, self.measures]
            is_hit = ~(changes <= NEGLIGIBLE * spreads).all(axis=1)
            hits.append(Hits(rows[is_hit], corrected[is_hit]))
        return hits

    def of_groups(self, groups: np.ndarray, changed_logs: np.ndarray, rows: np.ndarray) -> list[Hits]:
        """Return the rows that each of the groups (k,) changes on its own.

        Groups that change none of the first rows share the search in the remaining ones.
        """
        leading, remaining = np.split(rows, [FIRST_ROWS])
        first_hits = self.of_sets([(np.array([group]), leading) for group in groups], changed_logs)
        if not len(remaining):
            return first_hits
        is_frequent = np.array([len(hits.rows) > 0 for hits in first_hits], dtype=bool)
        further = dict(self.shared(groups[~is_frequent], changed_logs, remaining))
        frequent = self.of_sets([(np.array([group]), remaining) for group in groups[is_frequent]], changed_logs)
        further |= zip(groups[is_frequent].tolist(), frequent, strict=True)
        return [
            Hits(*map(np.concatenate, zip(hits, further[group], strict=True))) if group in further else hits
            for group, hits in zip(groups.tolist(), first_hits, strict=True)
        ]

    def shared(self, groups: np.ndarray, changed_logs: np.ndarray, rows: np.ndarray) -> list[tuple[int, Hits]]:
        """Return the groups that change any of the rows on their own, with these rows, by bisection of the groups."""
        sets, hits_of_groups = [(groups, rows)] if len(groups) else [], []
        while sets:
            halves = []
            for (members, _), hits in zip(sets, self.of_sets(sets, changed_logs), strict=True):
                if len(hits.rows) and len(members) == 1:
                    hits_of_groups.append((int(members[0]), hits))
                elif len(hits.rows):
                    halves += [(half, hits.rows) for half in np.array_split(members, 2)]
            sets = halves
        return hits_of_groups

    def idle(self, candidates: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
        """Return the candidates (group,) bool that jointly change no realization, with their ranges times either of `ends`.

        Other groups keep their ranges. If none of n realizations changes, the share of changing realizations is at most 3 / n,
        with 95 % confidence; requirements need n of at least ten times the inverse of the share that they allow.
        """
        idle = candidates.copy()
        for end in reversed(ends):
            logs, groups = np.full(len(candidates), np.log(end)), np.flatnonzero(idle)
            hits = self.of_groups(groups, logs, self.resolved_rows[:FIRST_BLOCK])
            idle[[group for group, hit in zip(groups, hits, strict=True) if len(hit.rows)]] = False
            while self._release(idle, logs):  # only a last run over all blocks shows that the remaining groups change nothing
                pass
        return idle

    def _release(self, idle: np.ndarray, logs: np.ndarray) -> bool:
        """Mark idle groups (group,) that change a realization as not idle; return whether there are any."""
        before, start, count = idle.sum(), 0, len(self.resolved_rows)
        while start < count and idle.any():
            stop = min(max(2 * start, FIRST_BLOCK), count)
            rows = self.resolved_rows[start:stop]
            while idle.any() and len(rows := self.of_sets([(np.flatnonzero(idle), rows)], logs)[0].rows):
                groups = np.flatnonzero(idle)
                influential = [group for group, _ in self.shared(groups, logs, rows[:MAX_HITS])]
                # Groups that change realizations only jointly are all influential.
                idle[influential or groups] = False
            start = stop
        return bool(idle.sum() < before)


def effect_samples(samples: int, groups: int) -> int:
    """Return the number of realizations, out of `samples`, for the effect of each group."""
    count = min(samples // EFFECT_SHARE, EFFECT_SHARE * samples // max(groups, 1))
    return min(max(count, MIN_EFFECT_SAMPLES), samples)


def narrowing_effects(trials: ScaledTrials) -> np.ndarray:
    """Return changes (measure, of_effect, group, interval) if a group's zones were a tenth narrower.

    Intervals come from means over batches of the same draws. A group that changes none of the first batches has no effect.
    """
    program = trials.engine.program
    limits = [program.limits(number) for number in range(len(program.nominal.measures))]
    ones = np.ones(len(trials))
    rows = np.arange(effect_samples(trials.samples, len(trials)))
    factors, leading = list(ones - STEP * np.eye(len(trials))), rows[:MIN_DECISIVE]
    present, *firsts = trials.corrected_rows([ones, *factors], [rows, *[leading] * len(trials)])
    negligible = NEGLIGIBLE * present.std(axis=0)
    groups = [k for k, x in enumerate(firsts) if (np.abs(x - present[: len(leading)]).max(axis=0) > negligible).any()]
    remaining = trials.corrected_rows([factors[k] for k in groups], [rows[len(leading) :]] * len(groups))
    effects = np.zeros((len(limits), len(terms.EFFECTS), len(trials), len(terms.ESTIMATE)))
    for group, values in zip(groups, remaining, strict=True):
        narrowed = np.concatenate([firsts[group], values])
        for measure, limits_of_measure in enumerate(limits):
            batches = [np.array_split(values[:, measure], BATCHES) for values in (narrowed, present)]
            spreads = [np.array([6 * x.std(ddof=1) for x in values]) for values in batches]
            shares = [np.array([limits_of_measure.outside(x).mean() for x in values]) for values in batches]
            effects[measure, 0, group] = mean(spreads[0] - spreads[1])
            effects[measure, 1, group] = mean(shares[0] - shares[1])
    return effects
