"""Realizations where required measures change if tolerance ranges change, by group of tolerances.

Most groups affect few realizations. The ranges of these groups are changed all at once; only where a realization changes, the
set of groups is bisected. So most groups cost almost nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact.analyses.scaled_trials import ScaledTrials, Trial

NEGLIGIBLE = 1e-6  # of a measure's spread: smaller changes count as 0
FIRST_ROWS = 32  # realizations for finding the groups that affect many


@dataclass(frozen=True, eq=False)
class Hits:
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

    def of_sets(self, sets: Sequence[tuple[np.ndarray, np.ndarray]], changed_logs: np.ndarray) -> list[Hits]:
        """Return the rows that each set of groups changes if the logarithms of its factors become `changed_logs` (group,).

        sets  groups (k,) that change at the same time, and the rows (row,) to check
        """
        factors = [np.exp(np.where(np.isin(np.arange(len(self.logs)), groups), changed_logs, self.logs)) for groups, _ in sets]
        rows_of_sets = [rows for _, rows in sets]
        resolved = self.before.corrected[self.before.is_resolved][:, self.measures]
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
        singles = [np.array([group]) for group in groups]
        first, others = np.split(rows, [FIRST_ROWS])
        first_hits = self.of_sets([(single, first) for single in singles], changed_logs)
        is_frequent = np.array([len(hits.rows) > 0 for hits in first_hits], dtype=bool)
        further = dict(self.shared(groups[~is_frequent], changed_logs, others)) if len(others) else {}
        frequent = [(single, others) for single, frequent in zip(singles, is_frequent, strict=True) if frequent]
        if len(others):
            further |= zip(groups[is_frequent].tolist(), self.of_sets(frequent, changed_logs), strict=True)
        return [_joined(hits, further.get(group)) for group, hits in zip(groups.tolist(), first_hits, strict=True)]

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


def _joined(first: Hits, further: Hits | None) -> Hits:
    if further is None:
        return first
    return Hits(np.concatenate([first.rows, further.rows]), np.concatenate([first.corrected, further.corrected]))
