"""Groups of tolerances without influence on required measures, at any range that an allocation may choose.

A group without effect near its present range may still be decisive once it is wider, or once others are narrower. So it counts
as idle only if no resolved realization of a run changes at its smallest and at its largest range. All groups that may be idle
are scaled at the same time: while nothing changes, all of them are idle, and the run costs as much as for one group. At the
largest ranges of influential groups many realizations are slow; so blocks of realizations grow, and each block is searched for
such groups before the next.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tolcontact.analyses.changed_rows import ChangedRows

FIRST_BLOCK = 64  # realizations; each further block has as many as all previous ones
MAX_HITS = 8  # changed realizations that are used to identify the groups


@dataclass(frozen=True, eq=False)
class IdleSearch:
    """The search for groups without influence.

    ends  smallest and largest factor of a range
    """

    changes: ChangedRows
    ends: tuple[float, float]

    @cached_property
    def rows(self) -> np.ndarray:
        """The numbers of the tested realizations (row,), which are resolved before the change."""
        return np.flatnonzero(self.changes.before.is_resolved)

    def idle(self, candidates: np.ndarray) -> np.ndarray:
        """Return the candidates (group,) bool that jointly change no realization, at either end of their ranges.

        Other groups keep their ranges. If none of n realizations changes, the share of changing realizations is at most 3 / n,
        with 95 % confidence; requirements need n of at least ten times the inverse of the share that they allow.
        """
        idle = candidates.copy()
        for end in reversed(self.ends):
            logs = np.full(len(candidates), np.log(end))
            first_rows = self.rows[:FIRST_BLOCK]
            groups = np.flatnonzero(idle)
            hits = self.changes.of_groups(groups, logs, first_rows)
            idle[[group for group, hit in zip(groups, hits, strict=True) if len(hit.rows)]] = False
            while self._release(idle, logs):  # only a last run over all blocks shows that the remaining groups change nothing
                pass
        return idle

    def _release(self, idle: np.ndarray, logs: np.ndarray) -> bool:
        """Mark idle groups (group,) that change a realization as not idle; return whether there are any."""
        before, start, count = idle.sum(), 0, len(self.rows)
        while start < count and idle.any():
            stop = min(max(2 * start, FIRST_BLOCK), count)
            rows = self.rows[start:stop]
            while idle.any() and len(rows := self.changes.of_sets([(np.flatnonzero(idle), rows)], logs)[0].rows):
                groups = np.flatnonzero(idle)
                influential = [group for group, _ in self.changes.shared(groups, logs, rows[:MAX_HITS])]
                # Groups that change realizations only jointly are all influential.
                idle[influential or groups] = False
            start = stop
        return bool(idle.sum() < before)
