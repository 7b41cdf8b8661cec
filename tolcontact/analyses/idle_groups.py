"""Groups of tolerances without influence on required measures, at any range that an allocation may choose.

A group that changes nothing near its present range may still decide once it is wider, or once others are narrower. So it counts
as idle only if no resolved realization of a run changes at its smallest and at its largest range. All groups that may be idle
are scaled together: while nothing changes, all of them are idle, and the run costs as much as that of one group. At the largest
ranges of groups with influence many realizations are slow; so blocks of realizations grow, and each of them is searched for
such groups before the next.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tolcontact.analyses.changed_rows import ChangedRows

FIRST_BLOCK = 64  # realizations; each further block has as many as all before
MAX_HITS = 8  # realizations that show which of the groups change them


@dataclass(frozen=True, eq=False)
class IdleSearch:
    """The search for groups without influence.

    ends  smallest and largest factor of a range
    """

    changes: ChangedRows
    ends: tuple[float, float]

    @cached_property
    def rows(self) -> np.ndarray:
        """The numbers of the realizations that are tried (row,): those that are resolved before."""
        return np.flatnonzero(self.changes.before.is_resolved)

    def idle(self, candidates: np.ndarray) -> np.ndarray:
        """Return which of the candidates (group,) bool change no realization together, at either end of their ranges.

        Groups that are no candidates stay where they are. No change in n realizations bounds the share of those that change to
        3 / n, with 95 % confidence; requirements need n of at least ten times the inverse of the share that they allow.
        """
        idle = candidates.copy()
        for end in reversed(self.ends):
            logs = np.full(len(candidates), np.log(end))
            few = self.rows[:FIRST_BLOCK]
            groups = np.flatnonzero(idle)
            hits = self.changes.of_groups(groups, logs, few)
            idle[[group for group, hit in zip(groups, hits, strict=True) if len(hit.rows)]] = False
            while self._release(idle, logs):  # a last run shows what no block alone does: that the groups left change nothing
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
                # Groups that change realizations only together are influential, all of them.
                idle[influential or groups] = False
            start = stop
        return bool(idle.sum() < before)
