"""The shape of a distribution, and what follows from it: estimates whose error is that of a mean of functions of each value."""

from collections.abc import Callable

import numpy as np

from tolcontact.statistics import intervals
from tolcontact.statistics.intervals import NOTHING, Estimate, is_constant
from tolcontact.statistics.sample import Sample


def skewness(x: np.ndarray | Sample) -> Estimate:
    """Third central moment over the cube of the standard deviation; 0 if symmetric."""
    x = Sample.of(x)
    if is_constant(x):
        return NOTHING
    skew, _ = standardized(x)
    return by_influence(x, skew, lambda z: z**3 - 3 * z - skew - 1.5 * skew * (z**2 - 1))


def kurtosis(x: np.ndarray | Sample) -> Estimate:
    """Fourth central moment over the square of the variance; 3 if normal."""
    x = Sample.of(x)
    if is_constant(x):
        return NOTHING
    skew, kurt = standardized(x)
    return by_influence(x, kurt, lambda z: z**4 - kurt - 4 * skew * z - 2 * kurt * (z**2 - 1))


def by_influence(x: Sample, estimate: float, influence: Callable[[np.ndarray], np.ndarray]) -> Estimate:
    """An estimate with the interval that its influence function of standardized values says."""
    scale = np.sqrt(x.moments[0])
    of = x.map(lambda piece: influence((piece - x.mean) / scale))
    squares = sum(float((piece**2).sum()) for piece in of.pieces())
    return intervals.by_influence(estimate, squares * of.widening**2, x.count)


def standardized(x: Sample) -> tuple[float, float]:
    """Third and fourth moment of standardized values."""
    scale, sums = np.sqrt(x.moments[0]), np.zeros(2)
    for piece in x.pieces():
        z = (piece - x.mean) / scale
        sums += (z**3).sum(), (z**4).sum()
    return float(sums[0] / x.count), float(sums[1] / x.count)
