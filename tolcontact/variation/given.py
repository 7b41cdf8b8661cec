"""Deviations that are given, where others are drawn."""

import numpy as np


class GivenDraws:
    """Deviations as Draws give them: the rows of an array (realization, contributor), whatever the seed."""

    def __init__(self, deviations: np.ndarray) -> None:
        self._deviations = deviations

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Deviations (realization, contributor); see Draws."""
        return self._deviations[start:stop]
