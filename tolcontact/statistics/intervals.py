"""Estimates from a Monte-Carlo sample with 95 % confidence intervals.

Every function takes a sample, an array (realization,) or a Sample, and returns (estimate, lower, upper). No interval assumes a
normal distribution: contact cuts distributions off.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from tolcontact.statistics.sample import Sample

CONFIDENCE = 0.95

_LOWER, _UPPER = 0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2
_Z = float(special.ndtri(_UPPER))


class Estimate(NamedTuple):
    """An estimate with the bounds of its 95 % confidence interval."""

    value: float
    lower: float
    upper: float


NOTHING = Estimate(math.nan, math.nan, math.nan)


def mean(x: np.ndarray | Sample) -> Estimate:
    """Mean, Student's t interval."""
    x = Sample.of(x)
    deviation = np.sqrt(_unbiased(x))
    half = float(student(x.count - 1) * deviation / np.sqrt(x.count)) * x.widening
    return Estimate(x.mean, x.mean - half, x.mean + half)


def student(freedom: float) -> float:
    """How many standard errors a 95 % interval reaches to either side: Student's t."""
    return float(special.stdtrit(freedom, _UPPER))


def by_influence(estimate: float, squares: float, count: int) -> Estimate:
    """An estimate whose influence function, what each of `count` realizations adds to it times `count`, has a sum of `squares`.

    See Serfling, Approximation Theorems of Mathematical Statistics (1980), chapter 6.
    """
    half = student(count - 1) * math.sqrt(squares / count / (count - 1))
    return Estimate(float(estimate), float(estimate - half), float(estimate + half))


def variance(x: np.ndarray | Sample) -> Estimate:
    """Variance; Bonett's interval (2006), on the log scale with the standard error that the fourth moment gives."""
    x = Sample.of(x)
    estimate, lower, upper = (float(value) for value in of_moments(x.count, *x.moments))
    widening = x.map(lambda piece: (piece - x.mean) ** 2).widening
    if widening == 1.0 or not estimate > 0:
        return Estimate(estimate, lower, upper)
    return Estimate(estimate, estimate * (lower / estimate) ** widening, estimate * (upper / estimate) ** widening)


def standard_deviation(x: np.ndarray | Sample, *, times: float = 1.0) -> Estimate:
    """`times` the standard deviation: 6 gives 6 sigma. Interval from that of the variance."""
    return root(variance(x), times=times)


def root(variance: Estimate, *, times: float = 1.0) -> Estimate:
    """`times` the root of a variance."""
    estimate, lower, upper = np.sqrt(variance)
    return Estimate(float(times * estimate), float(times * lower), float(times * upper))


def percentiles(x: np.ndarray | Sample, percents: Sequence[float]) -> list[Estimate]:
    """Percentiles; the intervals run between order statistics (binomial, distribution-free).

    A bound is infinite if the sample is too small to have one.
    """
    x = Sample.of(x)
    ranks = [_ranks(x.count, percent / 100) for percent in percents]
    values = x.ordered([min(max(rank, 0), x.count - 1) for group in ranks for rank in group[:4]]).reshape(-1, 4)
    widenings = [_below(x, own).widening for own in values[:, 2]]
    if any(widening != 1.0 for widening in widenings):
        ranks = [_spread(group, widening) for group, widening in zip(ranks, widenings, strict=True)]
        values = x.ordered([min(max(rank, 0), x.count - 1) for group in ranks for rank in group[:4]]).reshape(-1, 4)
    found = []
    for (below, above, _, _, share), (low, high, one, next_) in zip(ranks, values, strict=True):
        lower, upper = low if below >= 0 else -np.inf, high if above < x.count else np.inf
        # What lies between two order statistics may be beyond a bound, in small samples.
        found.append(Estimate(float(np.clip(one + (next_ - one) * share, lower, upper)), float(lower), float(upper)))
    return found


def percentile(x: np.ndarray | Sample, percent: float) -> Estimate:
    """One of `percentiles`."""
    return percentiles(x, [percent])[0]


def share(hits: np.ndarray | Sample) -> Estimate:
    """Share of True in a sample of booleans, exact (Clopper-Pearson) interval."""
    hits = Sample.of(hits)
    widening = hits.map(lambda piece: piece.astype(float)).widening
    k, n = sum(int(piece.sum()) for piece in hits.pieces()), hits.count
    return share_of(k / widening**2, n / widening**2) if 0 < k < n and widening > 0 else share_of(k, n)


def share_of(k: float, n: float) -> Estimate:
    """`share` of `k` hits among `n`."""
    lower = special.betaincinv(k, n - k + 1, _LOWER) if k > 0 else 0.0
    upper = special.betaincinv(k + 1, n - k, _UPPER) if k < n else 1.0
    return Estimate(k / n, float(lower), float(upper))


def variance_ratio(after: np.ndarray | Sample, before: np.ndarray | Sample) -> Estimate:
    """Variance of `after` over variance of `before`, from the same realizations (paired, on the log scale)."""
    after, before = Sample.of(after), Sample.of(before)
    ours, theirs = after.moments[0], before.moments[0]
    if is_constant(after) or is_constant(before):
        return NOTHING
    # What each realization adds to the logarithm of the ratio; the sum of all is zero.
    pairs = zip(after.pieces(), before.pieces(), strict=True)
    influence2 = sum((((a - after.mean) ** 2 / ours - (b - before.mean) ** 2 / theirs) ** 2).sum() for a, b in pairs)
    # The correction for small samples is Bonett's for one variance.
    n = after.count
    together = Sample(lambda: (
        (a - after.mean) ** 2 / ours - (b - before.mean) ** 2 / theirs
        for a, b in zip(after.pieces(), before.pieces(), strict=True)
    ), after.together)  # fmt: skip
    factor = np.exp(together.widening * _Z * n / (n - _Z) * np.sqrt((influence2 / n + 3 / n) / (n - 1)))
    return Estimate(ours / theirs, float(ours / theirs / factor), float(ours / theirs * factor))


def of_moments(count: int, second: ArrayLike, fourth: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`variance` of samples of which only the second and fourth central moment are known, of any shape."""
    second, fourth = np.asarray(second), np.asarray(fourth)
    with np.errstate(invalid="ignore", divide="ignore"):
        kurtosis = np.where(second > 0, fourth / second**2, 1.0)
    correction = count / (count - _Z)
    error = correction * np.sqrt(np.maximum(kurtosis - 1 + 3 / count, 0) / (count - 1))
    estimate = second * count / (count - 1)
    middle = correction * estimate
    return estimate, np.minimum(middle * np.exp(-_Z * error), estimate), middle * np.exp(_Z * error)


def is_constant(x: Sample) -> bool:
    """Whether what spread there is may be rounding."""
    return not x.moments[0] > (8 * np.finfo(float).eps * x.mean) ** 2


def _unbiased(x: Sample) -> float:
    return x.moments[0] * x.count / (x.count - 1)


def _ranks(n: int, p: float) -> tuple[int, int, int, int, float]:
    """Ranks, from 0, of the interval's bounds for the quantile `p`, and of the values that it lies between; and how far."""
    lower, upper = _binomial_quantile(_LOWER, n, p) - 1, _binomial_quantile(_UPPER, n, p)
    place = (n - 1) * p
    one = int(np.floor(place))
    return lower, upper, one, min(one + 1, n - 1), place - one


def _below(x: Sample, value: float) -> Sample:
    """1 for each number that is not above a value, 0 for the others."""
    return x.map(lambda piece: (piece <= value).astype(float))


def _spread(ranks: tuple[int, int, int, int, float], widening: float) -> tuple[int, int, int, int, float]:
    """Ranks with the interval's bounds nearer, or farther."""
    lower, upper, one, next_, share = ranks
    place = one + share
    return (
        int(np.floor(place - widening * (place - lower))),
        int(np.ceil(place + widening * (upper - place))),
        one,
        next_,
        share,
    )


def _binomial_quantile(q: float, n: int, p: float) -> int:
    """The least number of hits among n, each of probability p, that is not exceeded with probability `q`."""
    k = max(int(np.ceil(special.bdtrik(q, n, p))), 0)
    return k - 1 if k > 0 and special.bdtr(k - 1, n, p) >= q else k
