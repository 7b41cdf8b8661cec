"""Contributors that have an influence on a measure with contact, found by exchanging deviations between combinations.

Contributors that vary together, such as the components of a feature in a zone, are exchanged together: the combinations that
result lie in the region, too. A contributor without influence anywhere is found by exchanging all of them at once.
"""

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.analyses.allowed_space import AllowedRegion
from tolcontact.analyses.extreme_search import Evaluation

NEGLIGIBLE = 1e-6  # of a measure's spread: smaller changes are no influence
SINGLE = 2  # combinations in which contributors are exchanged one at a time
MAX_ROUNDS = 8


class Influences:
    """The contributors of a region that have an influence on each measure with contact, as far as is known.

    spread     (measure,) difference between the largest and the least value of random points
    is_active  (measure, contributor)
    """

    def __init__(self, region: AllowedRegion, evaluation: Evaluation, spread: np.ndarray) -> None:
        self._evaluation, self._units = evaluation, region.independent_columns
        self._tolerances = NEGLIGIBLE * spread
        self.is_active = np.zeros((len(spread), len(region.lower)), dtype=bool)

    def explore(self, points: np.ndarray, partners: np.ndarray) -> np.ndarray:
        """Find influences at points (n, contributor), by exchange with partners (n, contributor).

        Return whether there is one that was not known, (measure,).
        """
        before = self.is_active.copy()
        for _ in range(MAX_ROUNDS):
            hits = self._hidden(points, partners)
            if not hits.any():
                break
            rows = np.flatnonzero(hits.any(axis=1))[:SINGLE]
            unchanged = self.is_active.copy()
            self._explore_one_at_a_time(points[rows], partners[rows])
            interacts = hits[rows].any(axis=0) & (self.is_active == unchanged).all(axis=1)
            self.is_active[interacts] = True
        else:
            self.is_active[hits.any(axis=0)] = True
        return np.asarray((self.is_active != before).any(axis=1))

    def _hidden(self, points: np.ndarray, partners: np.ndarray) -> np.ndarray:
        """Return whether all contributors without known influence, exchanged together, change a measure, (n, measure)."""
        mixed = np.where(self.is_active[:, None], points, partners)
        changes = self._changes(self._corrected(points)[None], self._corrected(mixed))
        return np.asarray(changes[np.arange(len(mixed)), :, np.arange(len(mixed))].T)

    def _explore_one_at_a_time(self, points: np.ndarray, partners: np.ndarray) -> None:
        """Mark the contributors as active whose exchange changes a measure in any of the points (n, contributor)."""
        mixed = np.repeat(points[:, None], len(self._units), axis=1)
        for unit, columns in enumerate(self._units):
            mixed[:, unit, columns] = partners[:, columns]
        changes = np.any(self._changes(self._corrected(points)[:, None], self._corrected(mixed)), axis=0)
        for unit, columns in enumerate(self._units):
            self.is_active[np.ix_(np.flatnonzero(changes[unit]), columns)] = True

    def _corrected(self, points: np.ndarray) -> np.ndarray:
        return self._evaluation.corrected(points)[..., terms.CORRECTED, :]

    def _changes(self, values: np.ndarray, exchanged: np.ndarray) -> np.ndarray:
        """Return whether measures (..., measure) differ; also if one of them is certified and the other is not."""
        with np.errstate(invalid="ignore"):
            return np.asarray((np.abs(values - exchanged) > self._tolerances) | (np.isnan(values) != np.isnan(exchanged)))
