"""How capable a measure is of staying within its limits: shares, and Pp and Ppk, by percentiles and as if normal.

Contact cuts distributions off and skews them, so the figures by percentiles (ISO 22514-2, its general method) come first:
half of the values lie below X50, and 99.73 % between X0.135 and X99.865.

    Pp  = (U - L) / (X99.865 - X0.135)
    Ppk = min((U - X50) / (X99.865 - X50), (X50 - L) / (X50 - X0.135))

With one limit, Ppk is of its side, and there is no Pp. As of a normal distribution, X50 is the mean, and the differences are
3 and 6 standard deviations.
"""

from functools import lru_cache

import numpy as np
from scipy import special
from scipy.stats import qmc

from tolcontact.statistics.intervals import CONFIDENCE, NOTHING, Estimate, is_constant, percentiles, share
from tolcontact.statistics.moments import by_influence, standardized
from tolcontact.statistics.sample import Sample

TAIL, MEDIAN, HEAD = 0.135, 50.0, 99.865  # %
TRIALS = 1 << 11  # places of the three percentiles that an interval covers 95 % of
PLACES = 33  # how many order statistics around each percentile are read, at most


def below(x: Sample, limit: float) -> Estimate:
    """Share of values below the lower limit, exact interval; none if that side is open."""
    return share(x.map(lambda piece: piece < limit)) if np.isfinite(limit) else NOTHING


def above(x: Sample, limit: float) -> Estimate:
    """Share of values above the upper limit, exact interval; none if that side is open."""
    return share(x.map(lambda piece: piece > limit)) if np.isfinite(limit) else NOTHING


def outside(x: Sample, lower: float, upper: float) -> Estimate:
    """Share of values beyond the limits, exact interval; none without limits."""
    if not (np.isfinite(lower) or np.isfinite(upper)):
        return NOTHING
    return share(x.map(lambda piece: (piece < lower) | (piece > upper)))


def by_percentiles(x: Sample, lower: float, upper: float) -> tuple[Estimate, Estimate]:
    """Pp and Ppk by percentiles.

    How many of n values lie below each percentile of the distribution is multinomial, whatever the distribution is. So from
    these numbers follow places between order statistics where the percentiles may be, together; the interval leaves out 2.5 %
    of these places on either side. A sample that is too small to bound a tail has 0 as the lower bound.
    """
    if is_constant(x) or not np.isfinite(x.mean):
        return NOTHING, NOTHING
    tail, median, head = (each.value for each in percentiles(x, (TAIL, MEDIAN, HEAD)))
    tails, medians, heads = _places(x)
    pp, ppk = NOTHING, NOTHING
    if np.isfinite(lower) and np.isfinite(upper):
        pp = _of_places(_pp(tail, head, lower, upper), _pp(tails, heads, lower, upper))
    if np.isfinite(lower) or np.isfinite(upper):
        ppk = _of_places(_ppk(tail, median, head, lower, upper), _ppk(tails, medians, heads, lower, upper))
    return pp, ppk


def as_normal(x: Sample, lower: float, upper: float) -> tuple[Estimate, Estimate]:
    """Pp and Ppk from mean and standard deviation. Intervals do not take the distribution for a normal one."""
    if is_constant(x) or not np.isfinite(x.mean):
        return NOTHING, NOTHING
    s = float(np.sqrt(x.moments[0] * x.count / (x.count - 1)))
    _, kurt = standardized(x)
    pp, sides = NOTHING, []
    if np.isfinite(lower) and np.isfinite(upper) and kurt > 0:
        width = (upper - lower) / (6 * s)
        pp = by_influence(x, width, lambda z: -width / 2 * (z**2 - 1))
    if np.isfinite(upper):
        sides.append(_side(x, (upper - x.mean) / (3 * s), 1.0))
    if np.isfinite(lower):
        sides.append(_side(x, (x.mean - lower) / (3 * s), -1.0))
    return pp, min(sides, key=lambda side: side.value) if sides else NOTHING


def _side(x: Sample, index: float, sign: float) -> Estimate:
    return by_influence(x, index, lambda z: -sign * z / 3 - index / 2 * (z**2 - 1))


def _pp(tail: np.ndarray | float, head: np.ndarray | float, lower: float, upper: float) -> np.ndarray:
    with np.errstate(divide="ignore"):
        return np.asarray(np.divide(upper - lower, np.subtract(head, tail)))


def _ppk(
    tail: np.ndarray | float, median: np.ndarray | float, head: np.ndarray | float, lower: float, upper: float
) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore"):
        above = np.divide(upper - median, np.subtract(head, median)) if np.isfinite(upper) else np.inf
        below = np.divide(np.subtract(median, lower), np.subtract(median, tail)) if np.isfinite(lower) else np.inf
    return np.asarray(np.fmin(above, below))


def _of_places(estimate: np.ndarray, found: np.ndarray) -> Estimate:
    low, high = np.quantile(found, [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2], method="inverted_cdf")
    return Estimate(float(estimate), float(min(low, estimate)), float(max(high, estimate)))


def _places(x: Sample) -> np.ndarray:
    """Where the percentiles may be, (percentile, trial)."""
    ranks = _ranks(x.count)
    low = np.maximum(np.floor(ranks.min(axis=1)), 1)
    high = np.maximum(np.minimum(np.ceil(ranks.max(axis=1)), x.count), low)
    some = np.linspace(low, high, PLACES, axis=1).round().astype(np.int64)
    values = x.ordered((some - 1).ravel().tolist()).reshape(some.shape)  # at once: the sample is sorted for it
    places = np.array([np.interp(*each) for each in zip(ranks, some, values, strict=True)])
    return np.where(ranks < 1, -np.inf, np.where(ranks > x.count, np.inf, places))


@lru_cache
def _ranks(n: int) -> np.ndarray:
    """Places of the percentiles among `n` values in order, (percentile, trial): 1 is the least value, less is below it."""
    u = qmc.Sobol(3, rng=np.random.default_rng(0)).random(TRIALS).T
    p = np.array([TAIL, MEDIAN, HEAD]) / 100
    first = _hits(u[0], n, p[0])
    second = first + _hits(u[1], n - first, (p[1] - p[0]) / (1 - p[0]))
    return np.array([first, second, second + _hits(u[2], n - second, (p[2] - p[1]) / (1 - p[1]))]) + 1


def _hits(u: np.ndarray, n: np.ndarray | int, p: float) -> np.ndarray:
    """Quantiles of a binomial distribution less one, as places between whole numbers."""
    return np.where(u < (1 - p) ** n, -0.5, special.bdtrik(u, n, p))
