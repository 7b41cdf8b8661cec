"""Covariances of the heights of two points of a face, by their distance in correlation lengths. The variance is 1."""

from collections.abc import Callable

import numpy as np


def squared_exponential(distance: np.ndarray) -> np.ndarray:
    """Return the covariance of very smooth fields."""
    return np.asarray(np.exp(-(distance**2) / 2))


def matern_5_2(distance: np.ndarray) -> np.ndarray:
    """Return the covariance of fields that are twice differentiable."""
    scaled = np.sqrt(5) * distance
    return np.asarray((1 + scaled + scaled**2 / 3) * np.exp(-scaled))


def matern_3_2(distance: np.ndarray) -> np.ndarray:
    """Return the covariance of fields that are once differentiable."""
    scaled = np.sqrt(3) * distance
    return np.asarray((1 + scaled) * np.exp(-scaled))


COVARIANCES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "squared exponential": squared_exponential,
    "matern 5/2": matern_5_2,
    "matern 3/2": matern_3_2,
}
