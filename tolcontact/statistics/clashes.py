"""Statistics of bodies that lie in each other: how often, which, and how deep."""

from collections import Counter
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.realizations import pieces
from tolcontact.statistics import intervals
from tolcontact.vocabulary import ArchiveVariable

MAX_PAIRS = 20  # of parts that are named, the most frequent ones
VARIABLES = [variable.name for variable in (terms.CLASHES, terms.CLASH_DEPTH, terms.CLASH_PART, terms.CLASH_OTHER)]


class Clashes:
    """How often two parts lie in each other, of the rows of an archive.

    watched     number of realizations that were tested
    clashing    number of these in which parts without declared contact lie in each other
    counts      by both parts, and whether their contact is declared: number of realizations in which they lie deepest
    depths      [mm], by the same: their largest depth; missing if none is measured
    """

    def __init__(self, rows: xr.Dataset) -> None:
        self.watched, self.clashing = 0, 0
        self.counts = Counter[tuple[int, int, bool]]()
        self.depths = dict[tuple[int, int, bool], float]()
        self._parts = [str(name) for name in rows[terms.PART].values]
        for piece in pieces(rows[VARIABLES]):
            self._add(*(np.asarray(piece[name].values) for name in VARIABLES))

    def _add(self, clashes: np.ndarray, depth: np.ndarray, part: np.ndarray, other: np.ndarray) -> None:
        self.watched += int((clashes >= 0).sum())
        self.clashing += int((clashes > 0).sum())
        is_pair = np.all([(index >= 0) & (index < len(self._parts)) for index in (part, other)], axis=0)
        pairs = np.column_stack([part, other, clashes == 0])[is_pair].astype(int)
        labels, places = np.unique(pairs, axis=0, return_inverse=True)
        for k, (first, second, is_declared) in enumerate(labels.tolist()):
            pair, depths = (first, second, bool(is_declared)), depth[is_pair][places.ravel() == k]
            self.counts[pair] += len(depths)
            if np.isfinite(depths).any():
                self.depths[pair] = max(self.depths.get(pair, 0.0), float(np.nanmax(depths)))

    @property
    def pairs(self) -> list[tuple[int, int, bool]]:
        """The most frequent pairs of parts."""
        return [pair for pair, _ in self.counts.most_common(MAX_PAIRS)]

    @property
    def labels(self) -> list[str]:
        """The names of both parts of each pair."""
        return [f"{self._parts[first]} / {self._parts[second]}" for first, second, _ in self.pairs]

    def values(self) -> dict[ArchiveVariable, Any]:
        """Return the share of realizations with clashes, and what is known of each pair of parts."""
        share = intervals.proportion_of(self.clashing, self.watched) if self.watched else intervals.UNDEFINED
        return {
            terms.WATCHED: self.watched,
            terms.CLASH_SHARE: np.array(share),
            terms.CLASH_COUNT: np.array([self.counts[pair] for pair in self.pairs], dtype=np.int64),
            terms.CLASH_LARGEST_DEPTH: np.array([self.depths.get(pair, np.nan) for pair in self.pairs]),
            terms.CLASH_DECLARED: np.array([is_declared for *_, is_declared in self.pairs], dtype=np.int8),
        }
