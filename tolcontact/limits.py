"""Limits of a measure, and what lies beyond them.

Contact often keeps a measure exactly at a stop, and a limit at that stop is the most natural one. A solver finds the stop to
its own accuracy, so a value counts as beyond a limit only if it is beyond by more than the accuracy of the measure.
"""

import math
from typing import NamedTuple

import numpy as np

GAP_ACCURACY = 1e-8  # mm, of gaps of certified realizations (measured: 1e-9)


class Limits(NamedTuple):
    """The least and the largest allowed value of a measure, infinite or not a number where a side is open.

    accuracy   in the units of the measure: values that are beyond a limit by no more count as at the limit
    """

    lower: float
    upper: float
    accuracy: float = 0.0

    @property
    def are_open(self) -> bool:
        """Whether both sides are open."""
        return not (math.isfinite(self.lower) or math.isfinite(self.upper))

    @property
    def sides(self) -> "list[Limits]":
        """These limits one by one, as limits with one open side."""
        sides = [self._replace(upper=math.inf), self._replace(lower=-math.inf)]
        return [side for side in sides if not side.are_open]

    def excess(self, x: np.ndarray) -> np.ndarray:
        """Return by how much values lie beyond the limits and the accuracy; they are outside if it is above 0."""
        return np.fmax(self.lower - x, x - self.upper) - self.accuracy

    def below(self, x: np.ndarray) -> np.ndarray:
        """Return which values are below the lower limit."""
        return np.asarray(x < self.lower - self.accuracy)

    def above(self, x: np.ndarray) -> np.ndarray:
        """Return which values are above the upper limit."""
        return np.asarray(x > self.upper + self.accuracy)

    def outside(self, x: np.ndarray) -> np.ndarray:
        """Return which values are beyond one of the limits."""
        return self.below(x) | self.above(x)

    def settled(self, x: np.ndarray) -> np.ndarray:
        """Return values; each that lies at a limit, to the accuracy, equals the limit."""
        for limit in (self.lower, self.upper):
            x = np.where(np.abs(x - limit) <= self.accuracy, limit, x)
        return x
