"""Statistics of contact: pairs that carry, what they carry, and points that touch."""

from collections import Counter

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.realizations import pieces
from tolcontact.statistics import intervals
from tolcontact.statistics.sample import Sample

MAX_COMBINATIONS = 10  # of pairs that carry together


def carried(rows: xr.Dataset) -> np.ndarray:
    """Return the share of realizations in which each pair carries, (pair, interval)."""
    counts = np.sum([(piece[terms.CARRYING.name].values > 0).sum(axis=0) for piece in pieces(rows)], axis=0)
    total = rows.sizes[terms.REALIZATION]
    return np.array([intervals.proportion_of(int(k), total) for k in counts]).reshape(-1, len(terms.ESTIMATE))


def reactions(rows: xr.Dataset) -> np.ndarray:
    """Return mean and percentiles of the reaction of each pair over all realizations, (pair, of_reaction, interval)."""
    estimates = []
    for pair in range(rows.sizes[terms.PAIR]):
        reaction = rows[[terms.REACTION.name]].isel({terms.PAIR: pair})
        x = Sample(lambda rows=reaction: (np.asarray(piece[terms.REACTION.name].values) for piece in pieces(rows)))  # type: ignore[misc]
        estimates.append([intervals.mean(x), *intervals.percentiles(x, terms.REACTION_PERCENTILES)])
    return np.array(estimates).reshape(-1, 1 + len(terms.REACTION_PERCENTILES), len(terms.ESTIMATE))


def combinations(rows: xr.Dataset) -> list[tuple[tuple[str, ...], int]]:
    """Return which pairs carry together, and in how many realizations: the most frequent combinations."""
    names, counts = [str(name) for name in rows[terms.PAIR].values], Counter[tuple[bool, ...]]()
    for piece in pieces(rows):
        masks, times = _unique_rows(piece[terms.CARRYING.name].values > 0)
        counts.update({tuple(mask.tolist()): int(n) for mask, n in zip(masks, times, strict=True)})
    frequent = counts.most_common(MAX_COMBINATIONS)
    return [(tuple(name for name, carries in zip(names, mask, strict=True) if carries), n) for mask, n in frequent]


def _unique_rows(masks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the different rows of booleans (row, column), and how often each occurs. They are compared as whole numbers."""
    words = np.zeros((len(masks), max(-(-masks.shape[1] // 64), 1)), dtype=np.uint64)
    words.view(np.uint8)[:, : -(-masks.shape[1] // 8)] = np.packbits(masks, axis=1)
    if words.shape[1] == 1:
        unique, times = np.unique(words, return_counts=True)
    else:
        unique, times = np.unique(words, axis=0, return_counts=True)  # takes ten times as long
    bits = np.unpackbits(unique.reshape(-1, words.shape[1]).view(np.uint8), axis=1)
    return bits[:, : masks.shape[1]].astype(bool), times


class TouchingShares:
    """How often each contact point touches, summed up over realizations; nothing yet.

    is_new   whether realizations were added since the last `values`
    """

    def __init__(self, points: int) -> None:
        self._counts, self._realizations = np.zeros(points, dtype=np.int64), 0
        self.is_new = True

    def add(self, counts: np.ndarray, realizations: int) -> None:
        """Add in how many of some `realizations` each point touches, counts (point,)."""
        self._counts += counts
        self._realizations += realizations
        self.is_new |= realizations > 0

    def values(self) -> tuple[np.ndarray, np.ndarray, int]:
        """Return shares (point,), their intervals (point, bound) and the number of realizations; NaN if there are none."""
        self.is_new = False
        if not self._realizations:
            return np.full(len(self._counts), np.nan), np.full((len(self._counts), len(terms.BOUNDS)), np.nan), 0
        counts, place = np.unique(self._counts, return_inverse=True)
        estimates = np.array([intervals.proportion_of(int(count), self._realizations) for count in counts])
        estimates = estimates.reshape(-1, len(terms.ESTIMATE))[place]
        return estimates[:, 0], estimates[:, 1:], self._realizations
