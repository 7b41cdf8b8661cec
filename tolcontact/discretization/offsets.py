"""Offsets: how far contact points stand out of their reference face, linear in what varies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Offsets:
    """What contributors add to the height of the points of a pair along n^r; their gaps are less by that.

    columns   (contributor,): columns of the deviations
    matrix    (contributor, point): height of each point for a deviation of 1
    """

    columns: np.ndarray
    matrix: np.ndarray

    @classmethod
    def none(cls, points: int) -> "Offsets":
        """Points that stand out by nothing."""
        return cls(np.zeros(0, dtype=int), np.zeros((0, points)))

    @classmethod
    def joined(cls, every: "Sequence[Offsets]", points: int) -> "Offsets":
        """The sum of several offsets of the same points."""
        columns = np.unique(np.concatenate([np.zeros(0, dtype=int), *(own.columns for own in every)]))
        matrix = np.zeros((len(columns), points))
        for own in every:
            matrix[np.searchsorted(columns, own.columns)] += own.matrix
        return cls(columns, matrix)

    def take(self, points: np.ndarray) -> "Offsets":
        """The offsets of some points."""
        return Offsets(self.columns, self.matrix[:, points])

    def heights(self, deviations: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Heights (row, slot) [mm] of `points` (row, slot) for deviations (row, column), summed up in a fixed order."""
        heights = np.zeros(points.shape)
        for column, row in zip(self.columns, self.matrix, strict=True):
            heights += deviations[:, column, None] * row[points]
        return heights
