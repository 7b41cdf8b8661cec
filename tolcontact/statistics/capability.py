"""Capability of a measure: the shares beyond its limits, and Pp and Ppk, by percentiles and as of a normal distribution.

Contact cuts distributions off and skews them, so the figures by percentiles (the general method of ISO 22514-2) come first:
half of the values lie below X50, and 99.73 % between X0.135 and X99.865.

    Pp  = (U - L) / (X99.865 - X0.135)
    Ppk = min((U - X50) / (X99.865 - X50), (X50 - L) / (X50 - X0.135))

With one limit, Ppk is that of its side, and there is no Pp. As of a normal distribution, X50 is the mean, and the differences
are 3 and 6 standard deviations.
"""

from functools import lru_cache

import numpy as np
import scipy
from scipy import special

from tolcontact.statistics.intervals import (
    CONFIDENCE,
    UNDEFINED,
    Estimate,
    from_standardized_influence,
    is_constant,
    percentiles,
    proportion,
)
from tolcontact.statistics.sample import Sample

LOW, MEDIAN, HIGH = PERCENTS = 0.135, 50.0, 99.865
TRIALS = 1 << 11  # simulated triples of percentiles, of which an interval covers 95 %
MAX_ORDER_STATISTICS = 33  # that are read around each percentile


def share_below(x: Sample, limit: float) -> Estimate:
    """Return the share of values below the lower limit, with its exact interval; undefined if that side is open."""
    return proportion(x.map(lambda piece: piece < limit)) if np.isfinite(limit) else UNDEFINED


def share_above(x: Sample, limit: float) -> Estimate:
    """Return the share of values above the upper limit, with its exact interval; undefined if that side is open."""
    return proportion(x.map(lambda piece: piece > limit)) if np.isfinite(limit) else UNDEFINED


def share_outside(x: Sample, lower: float, upper: float) -> Estimate:
    """Return the share of values beyond the limits, with its exact interval; undefined without limits."""
    if not (np.isfinite(lower) or np.isfinite(upper)):
        return UNDEFINED
    return proportion(x.map(lambda piece: (piece < lower) | (piece > upper)))


def by_percentiles(x: Sample, lower: float, upper: float) -> tuple[Estimate, Estimate]:
    """Return Pp and Ppk by percentiles.

    The numbers of values below the three percentiles are multinomial for any distribution. Simulated numbers give joint
    positions of the percentiles between order statistics; the interval leaves out 2.5 % of the simulated indices on either
    side. A sample that is too small to bound a tail has 0 as the lower bound.
    """
    if is_constant(x) or not np.isfinite(x.mean):
        return UNDEFINED, UNDEFINED
    low, median, high = (percentile.value for percentile in percentiles(x, PERCENTS))
    lows, medians, highs = _simulated_percentiles(x)
    pp, ppk = UNDEFINED, UNDEFINED
    if np.isfinite(lower) and np.isfinite(upper):
        pp = _with_interval(_pp(low, high, lower, upper), _pp(lows, highs, lower, upper))
    if np.isfinite(lower) or np.isfinite(upper):
        ppk = _with_interval(_ppk(low, median, high, lower, upper), _ppk(lows, medians, highs, lower, upper))
    return pp, ppk


def as_normal(x: Sample, lower: float, upper: float) -> tuple[Estimate, Estimate]:
    """Return Pp and Ppk from mean and standard deviation; their intervals do not assume a normal distribution."""
    if is_constant(x) or not np.isfinite(x.mean):
        return UNDEFINED, UNDEFINED
    deviation = float(np.sqrt(x.moments[0] * x.count / (x.count - 1)))
    _, kurt = x.standardized_moments
    pp, sides = UNDEFINED, []
    if np.isfinite(lower) and np.isfinite(upper) and kurt > 0:
        width = (upper - lower) / (6 * deviation)
        pp = from_standardized_influence(x, width, lambda z: -width / 2 * (z**2 - 1))
    if np.isfinite(upper):
        sides.append(_side(x, (upper - x.mean) / (3 * deviation), 1.0))
    if np.isfinite(lower):
        sides.append(_side(x, (x.mean - lower) / (3 * deviation), -1.0))
    return pp, min(sides, key=lambda side: side.value) if sides else UNDEFINED


def _side(x: Sample, index: float, sign: float) -> Estimate:
    """Return the index of one side as of a normal distribution; `sign` is 1 for the upper limit, -1 for the lower."""
    return from_standardized_influence(x, index, lambda z: -sign * z / 3 - index / 2 * (z**2 - 1))


def _pp(low: np.ndarray | float, high: np.ndarray | float, lower: float, upper: float) -> np.ndarray:
    with np.errstate(divide="ignore"):
        return np.divide(upper - lower, np.subtract(high, low))


def _ppk(
    low: np.ndarray | float, median: np.ndarray | float, high: np.ndarray | float, lower: float, upper: float
) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore"):
        upper_index = np.divide(upper - median, np.subtract(high, median)) if np.isfinite(upper) else np.inf
        lower_index = np.divide(np.subtract(median, lower), np.subtract(median, low)) if np.isfinite(lower) else np.inf
    return np.fmin(upper_index, lower_index)


def _with_interval(estimate: np.ndarray, simulated: np.ndarray) -> Estimate:
    """Return an estimate with the interval that covers 95 % of the simulated values."""
    low, high = np.quantile(simulated, [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2], method="inverted_cdf")
    return Estimate(float(estimate), float(min(low, estimate)), float(max(high, estimate)))


def _simulated_percentiles(x: Sample) -> np.ndarray:
    """Return possible values of the three percentiles of the distribution, (percentile, trial)."""
    ranks = percentile_ranks(x.count)
    low = np.maximum(np.floor(ranks.min(axis=1)), 1)
    high = np.maximum(np.minimum(np.ceil(ranks.max(axis=1)), x.count), low)
    nodes = np.linspace(low, high, MAX_ORDER_STATISTICS, axis=1).round().astype(np.int64)
    values = x.ordered((nodes - 1).ravel().tolist()).reshape(nodes.shape)  # in one call, which sorts the sample
    simulated = np.array([np.interp(*curve) for curve in zip(ranks, nodes, values, strict=True)])
    return np.where(ranks < 1, -np.inf, np.where(ranks > x.count, np.inf, simulated))


@lru_cache
def percentile_ranks(n: int) -> np.ndarray:
    """Return simulated ranks of the percentiles among `n` ordered values, (percentile, trial).

    Rank 1 is the least value; a rank below 1 lies below all values.
    """
    u = scipy.stats.qmc.Sobol(3, rng=np.random.default_rng(0)).random(TRIALS).T
    p = np.array(PERCENTS) / 100
    below_low = _hits(u[0], n, p[0])
    below_median = below_low + _hits(u[1], n - below_low, (p[1] - p[0]) / (1 - p[0]))
    below_high = below_median + _hits(u[2], n - below_median, (p[2] - p[1]) / (1 - p[1]))
    return np.array([below_low, below_median, below_high]) + 1


def _hits(u: np.ndarray, n: np.ndarray | int, p: float) -> np.ndarray:
    """Return quantiles `u` of a binomial distribution minus one, interpolated between whole numbers."""
    return np.where(u < (1 - p) ** n, -0.5, special.bdtrik(u, n, p))
