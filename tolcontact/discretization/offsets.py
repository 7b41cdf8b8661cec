"""Heights of contact points that are linear in the deviations."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Offsets:
    """Heights of the contact points of a pair along n^r, linear in the deviations. Gaps are smaller by these heights.

    columns   (contributor,): columns of the deviations
    matrix    (contributor, point): height of each point for a deviation of 1
    """

    columns: np.ndarray
    matrix: np.ndarray

    @classmethod
    def none(cls, points: int) -> "Offsets":
        """Return the offsets of points whose heights do not vary."""
        return cls(np.zeros(0, dtype=int), np.zeros((0, points)))

    @classmethod
    def joined(cls, terms: "Sequence[Offsets]", points: int) -> "Offsets":
        """Return the sum of several offsets of the same points."""
        columns = np.unique(np.concatenate([np.zeros(0, dtype=int), *(term.columns for term in terms)]))
        matrix = np.zeros((len(columns), points))
        for term in terms:
            matrix[np.searchsorted(columns, term.columns)] += term.matrix
        return cls(columns, matrix)

    def take(self, points: np.ndarray) -> "Offsets":
        """Return the offsets of some points."""
        return Offsets(self.columns, self.matrix[:, points])

    def heights(self, deviations: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return heights (row, slot) [mm] of `points` (row, slot) for deviations (row, column), summed up in a fixed order."""
        heights = np.zeros(points.shape)
        for column, row in zip(self.columns, self.matrix, strict=True):
            heights += deviations[:, column, None] * row[points]
        return heights
