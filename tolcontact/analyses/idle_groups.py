"""Groups of tolerances without influence on required measures, at any range that an allocation may choose.

A group that changes nothing near its present range may still decide once it is wider, or once others are narrower. So it counts
as idle only if no realization of a whole run changes at its smallest and at its largest range. All groups that may be idle are
scaled together: while nothing changes, all of them are idle, and the run costs as much as that of one group.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact.analyses.scaled_trials import ScaledTrials

NEGLIGIBLE = 1e-6  # of a measure's spread: smaller changes are no influence
FEW = 64  # realizations that show most influences, one group at a time


@dataclass(frozen=True, eq=False)
class IdleSearch:
    """The search for groups without influence.

    measures  numbers of the measures that are required
    ends      smallest and largest factor of a range
    """

    trials: ScaledTrials
    measures: Sequence[int]
    ends: tuple[float, float]

    def idle(self, logs: np.ndarray, corrected: np.ndarray, candidates: np.ndarray) -> np.ndarray:
        """Return which of the candidates (group,) bool change no required measure at either end of their ranges.

        `corrected` (n, measure) are the realizations at `logs` (group,), the logarithms of the factors; groups that are no
        candidates stay there. No change in n realizations bounds the share of those that change to 3 / n, with 95 %
        confidence; requirements need n of at least ten times the inverse of the share that they allow.
        """
        idle = candidates.copy()
        few = np.arange(min(FEW, len(corrected)))
        for group in np.flatnonzero(candidates):
            idle[group] = not len(self._changed(logs, corrected, np.array([group]), self.ends[1], few))
        every = np.arange(len(corrected))
        for end in reversed(self.ends):
            while idle.any() and len(rows := self._changed(logs, corrected, np.flatnonzero(idle), end, every)):
                idle[self._influential(logs, corrected, np.flatnonzero(idle), end, rows)] = False
        return idle

    def _influential(
        self, logs: np.ndarray, corrected: np.ndarray, groups: np.ndarray, end: float, rows: np.ndarray
    ) -> np.ndarray:
        """Return those of the groups (k,) that change some of the rows, which all of them together change.

        Groups that change them only together are influential, all of them.
        """
        if len(groups) == 1:
            return groups
        parts = [(part, self._changed(logs, corrected, part, end, rows)) for part in np.array_split(groups, 2)]
        hits = [self._influential(logs, corrected, part, end, changed) for part, changed in parts if len(changed)]
        return np.concatenate(hits) if hits else groups

    def _changed(self, logs: np.ndarray, corrected: np.ndarray, groups: np.ndarray, end: float, rows: np.ndarray) -> np.ndarray:
        """Return those of the rows in which a required measure changes if the ranges of groups are at one end."""
        factors = np.exp(logs)
        factors[groups] = end
        is_whole = len(rows) == len(corrected)
        scaled = self.trials.corrected(factors) if is_whole else self.trials.corrected_rows(factors, rows)
        changes = np.abs(scaled - corrected[rows])[:, self.measures]
        spreads = corrected.std(axis=0)[self.measures]
        return rows[~(changes <= NEGLIGIBLE * spreads).all(axis=1)]
