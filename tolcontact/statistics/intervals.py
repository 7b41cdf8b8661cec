"""Estimates from a Monte-Carlo sample with 95 % confidence intervals.

Every function takes a sample, an array (realization,) or a Sample, and returns (estimate, lower, upper). No interval assumes a
normal distribution, since contact truncates distributions.

Two samples are `paired` if realization k of both forms a pair. Pairs are independent of each other whether or not their two
members are, so paired intervals hold for any two runs with the same number of realizations; equal draws make them narrow. In
runs with a sampling plan the differences of replicates determine the width of intervals (see Sample.widening).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from tolcontact.statistics.sample import Sample

CONFIDENCE = 0.95
MIN_VARIANCE = 20  # realizations: variances of fewer have no interval
MIN_RATIO = 50  # realizations: ratios of variances of fewer have no interval
MIN_SHAPE, MAX_KURTOSIS = 1000, 3.5  # realizations, and their kurtosis: otherwise skewness and kurtosis have no interval
MIN_SKEW = 1e-6

_LOWER, _UPPER = 0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2
_Z = float(special.ndtri(_UPPER))


class Estimate(NamedTuple):
    """An estimate with the bounds of its 95 % confidence interval."""

    value: float
    lower: float
    upper: float


UNDEFINED = Estimate(math.nan, math.nan, math.nan)


def mean(x: np.ndarray | Sample) -> Estimate:
    """Return the mean with Student's t interval, widened by the interval of Hall's transformation for skewed values.

    There is none if too few values are apart from a stop.
    """
    x = Sample.of(x)
    if not x.determines_moments:
        return Estimate(x.mean, math.nan, math.nan)
    if not x.moments[0] > 0:
        return Estimate(x.mean, x.mean, x.mean) if math.isfinite(x.mean) else UNDEFINED
    deviation, t = math.sqrt(x.moments[0] * x.count / (x.count - 1)), student(x.count - 1) * x.widening
    skew, half = float(x.standardized_moments[3]), t * deviation / math.sqrt(x.count)
    lower, upper = (x.mean - deviation * _back(sign * t, skew, x.count) for sign in (1, -1))
    return Estimate(x.mean, min(lower, x.mean - half), max(upper, x.mean + half))


def student(freedom: float) -> float:
    """Return the half width of a 95 % interval in standard errors: Student's t for `freedom` degrees of freedom."""
    return float(special.stdtrit(freedom, _UPPER))


def from_influences(estimate: float, influences: np.ndarray) -> Estimate:
    """Return an estimate whose influence function has the value `influences` (realization,) for each realization.

    The influence of a realization is its contribution to the estimate times their number; their sum is 0. See Serfling,
    Approximation Theorems of Mathematical Statistics (1980), chapter 6.
    """
    squares = influences**2
    return _from_sums(
        estimate, len(squares), float(squares.sum()), float((squares * influences).sum()), float((squares**2).sum())
    )


def _from_sums(estimate: float, count: int, squares: float, cubes: float, fourths: float) -> Estimate:
    """Return an estimate whose influence function over `count` realizations has sums of powers.

    The fourth powers give the effective degrees of freedom of Student's t: there are fewer if the spread comes from few
    realizations. The interval contains the one by Hall's transformation, which accounts for skewed influences.
    """
    if not squares > 0:
        return Estimate(float(estimate), float(estimate), float(estimate))
    freedom = min(max(2 * count / max(count * fourths / squares**2 - 1, 1e-12), 1.0), count - 1.0)
    deviation, t, skew = math.sqrt(squares / (count - 1)), student(freedom), cubes / squares**1.5 * math.sqrt(count)
    half = t * deviation / math.sqrt(count)
    below, above = (deviation * _back(sign * t, skew, count) for sign in (1, -1))
    return Estimate(float(estimate), float(estimate - max(half, below)), float(estimate + max(half, -above)))


def from_standardized_influence(x: Sample, estimate: float, influence: Sequence[float]) -> Estimate:
    """Return an estimate whose influence function is a polynomial of the standardized values, of degree 4 at most.

    The polynomial is given by its coefficients, starting with the constant. There is no interval if the sample is too small.
    """
    if x.count < MIN_VARIANCE or not x.determines_moments:
        return Estimate(float(estimate), math.nan, math.nan)
    scale, square = np.sqrt(x.moments[0]), np.convolve(influence, influence)
    squares, cubes, fourths = (  # sums over the standardized values
        float(polynomial @ x.standardized_moments[: len(polynomial)] * x.count)
        for polynomial in (square, np.convolve(square, influence), np.convolve(square, square))
    )
    widening = x.map(lambda values: np.polyval(influence[::-1], (values - x.mean) / scale)).widening
    return _from_sums(estimate, x.count, squares * widening**2, cubes * widening**3, fourths * widening**4)


def skewness(x: np.ndarray | Sample) -> Estimate:
    """Return the third central moment over the cube of the standard deviation; 0 for a symmetric distribution."""
    return _shape(Sample.of(x), 3)


def kurtosis(x: np.ndarray | Sample) -> Estimate:
    """Return the fourth central moment over the square of the variance; 3 for a normal distribution."""
    return _shape(Sample.of(x), 4)


def _shape(x: Sample, order: int) -> Estimate:
    """Return a standardized moment. Small samples do not give the moments that its spread depends on."""
    if is_constant(x):
        return UNDEFINED
    skew, kurt = x.standardized_moments[3:5].tolist()
    if x.count < MIN_SHAPE or not kurt < MAX_KURTOSIS:
        return Estimate(skew if order == 3 else kurt, math.nan, math.nan)
    if order == 3:
        return from_standardized_influence(x, skew, [0.5 * skew, -3, -1.5 * skew, 1])
    return from_standardized_influence(x, kurt, [kurt, -4 * skew, -2 * kurt, 0, 1])


def variance(x: np.ndarray | Sample) -> Estimate:
    """Return the variance with the interval of its influences on the log scale.

    The upper bound has Bonett's correction for small samples (2006). There is no interval of the smallest samples, and of those
    with too few values apart from a stop.
    """
    x = Sample.of(x)
    estimate = x.moments[0] * x.count / (x.count - 1)
    if estimate > 0:
        _, below, above = from_standardized_influence(x, 0.0, [-1, 0, 1])
        return Estimate(estimate, estimate * math.exp(below), estimate * math.exp(above * x.count / (x.count - _Z)))
    is_certain = x.count >= MIN_VARIANCE and x.determines_moments
    return Estimate(estimate, *(2 * [estimate if is_certain else math.nan]))


def _back(z: float, skew: float, count: int) -> float:
    """Return the inverse of Hall's transformation at z: standard errors over the root of the count."""
    if abs(skew) < MIN_SKEW:
        return z / math.sqrt(count)
    return float(3 / skew * (np.cbrt(1 + skew * (z / math.sqrt(count) - skew / (6 * count))) - 1))


def standard_deviation(x: np.ndarray | Sample, *, times: float = 1.0) -> Estimate:
    """Return `times` the standard deviation (6 gives 6 sigma), with the interval of the variance."""
    return root(variance(x), times=times)


def root(variance: Estimate, *, times: float = 1.0) -> Estimate:
    """Return `times` the root of a variance."""
    estimate, lower, upper = np.sqrt(variance)
    return Estimate(float(times * estimate), float(times * lower), float(times * upper))


def percentiles(x: np.ndarray | Sample, percents: Sequence[float]) -> list[Estimate]:
    """Return percentiles with intervals between order statistics (binomial, distribution-free).

    A bound is infinite if the sample is too small. All are undefined if a value is not finite.
    """
    x = Sample.of(x)
    if not math.isfinite(x.mean):
        return [UNDEFINED] * len(percents)
    shares, last = np.array(percents) / 100, x.count - 1
    places = last * shares  # ranks, from 0, of the percentiles and of the bounds of their intervals
    floors = np.floor(places).astype(int)
    lower, upper = np.array([binomial_quantile([_LOWER, _UPPER], x.count, share) for share in shares]).T
    lower -= 1
    below, above = x.ordered(floors), x.ordered(np.minimum(floors + 1, last))
    widenings = np.array([x.map(lambda values, v=v: (values <= v).astype(float)).widening for v in below])  # type: ignore[misc]
    if (widenings != 1.0).any():
        lower = np.floor(places - widenings * (places - lower)).astype(int)
        upper = np.ceil(places + widenings * (upper - places)).astype(int)
    lows = np.where(lower >= 0, x.ordered(lower.clip(0, last)), -np.inf)
    highs = np.where(upper <= last, x.ordered(upper.clip(0, last)), np.inf)
    # In small samples the interpolated value may lie beyond a bound.
    values = np.clip(below + (above - below) * (places - floors), lows, highs)
    return [Estimate(*map(float, estimate)) for estimate in zip(values, lows, highs, strict=True)]


def proportion(hits: np.ndarray | Sample) -> Estimate:
    """Return the share of True in a sample of booleans with the exact (Clopper-Pearson) interval."""
    hits = Sample.of(hits)
    widening = hits.map(lambda values: values.astype(float)).widening
    k, n = int(hits.values.sum()), hits.count
    return proportion_of(k / widening**2, n / widening**2) if 0 < k < n and widening > 0 else proportion_of(k, n)


def proportion_of(k: float, n: float) -> Estimate:
    """Return the share of `k` hits among `n` trials with the exact (Clopper-Pearson) interval."""
    lower = special.betaincinv(k, n - k + 1, _LOWER) if k > 0 else 0.0
    upper = special.betaincinv(k + 1, n - k, _UPPER) if k < n else 1.0
    return Estimate(k / n, float(lower), float(upper))


def shift(sample: Sample, baseline: Sample, *, paired: bool) -> Estimate:
    """Return the difference of the means: Student's t of paired differences, or Welch's interval."""
    if paired:
        return mean(sample - baseline)
    squared_errors = [x.moments[0] / (x.count - 1) * x.widening**2 for x in (sample, baseline)]
    difference, total = sample.mean - baseline.mean, sum(squared_errors)
    if not (sample.determines_moments and baseline.determines_moments):
        return Estimate(difference, math.nan, math.nan)
    if not total > 0:
        return Estimate(difference, difference, difference) if math.isfinite(difference) else UNDEFINED
    freedom = total**2 / sum(error**2 / (x.count - 1) for error, x in zip(squared_errors, (sample, baseline), strict=True))
    half = student(freedom) * math.sqrt(total)
    return Estimate(difference, difference - half, difference + half)


def variance_ratio(sample: np.ndarray | Sample, baseline: np.ndarray | Sample, *, paired: bool = True) -> Estimate:
    """Return the ratio of the variances, with an interval on the log scale.

    If the samples are not paired, it comes from the intervals of both (Zou and Donner, 2008). If the lower bound of the second
    variance is 0, the ratio then has no upper bound.
    """
    sample, baseline = Sample.of(sample), Sample.of(baseline)
    if is_constant(sample) or is_constant(baseline):
        return UNDEFINED
    if not paired:
        (value, lower, upper), (base, base_lower, base_upper) = np.array([variance(x) for x in (sample, baseline)])
        with np.errstate(divide="ignore"):
            below, above = np.hypot(np.log([value / lower, upper / value]), np.log([base_upper / base, base / base_lower]))
        return Estimate(value / base, float(value / base * np.exp(-below)), float(value / base * np.exp(above)))
    # The influence of each realization on the logarithm of the ratio; their sum is zero.
    influence = _standardized_squares(sample) - _standardized_squares(baseline)
    ratio, n = sample.moments[0] / baseline.moments[0], sample.count
    if n < MIN_RATIO or not (sample.determines_moments and baseline.determines_moments):
        return Estimate(ratio, math.nan, math.nan)
    squares, cubes, fourths = (float((influence.values**k).sum()) for k in (2, 3, 4))
    # The correction for small samples is Bonett's for one variance.
    _, lower, upper = _from_sums(0.0, n, squares + 3, cubes, fourths)
    return Estimate(ratio, ratio * math.exp(lower * influence.widening), ratio * math.exp(upper * influence.widening))


def _standardized_squares(x: Sample) -> Sample:
    return x.map(lambda values: (values - x.mean) ** 2 / x.moments[0])


def share_shift(sample: Sample, baseline: Sample, *, paired: bool) -> Estimate:
    """Return the difference of two shares, from samples of booleans.

    If the samples are paired, the distances of the exact bounds of the shares that are gained and lost add up like errors
    (Zou and Donner, 2008); both shares are correlated. If not, the interval is Wald's after one hit and one miss more in each
    sample (Agresti and Caffo, 2000).
    """
    hits = [x.map(lambda values: values.astype(float)) for x in (sample, baseline)]
    if paired:
        change = hits[0] - hits[1]
        weight = _weight(change)
        counts = [weight * int((change.values == sign).sum()) for sign in (1, -1)]
        gained, lost = (proportion_of(count, weight * change.count) for count in counts)
        odds = math.prod(share.value / (1 - share.value) for share in (gained, lost) if share.value < 1)
        least = hypotenuse(gained.value - gained.lower, lost.upper - lost.value, math.sqrt(odds))
        most = hypotenuse(gained.upper - gained.value, lost.value - lost.lower, math.sqrt(odds))
        difference = gained.value - lost.value
        return Estimate(difference, max(difference - least, -1.0), min(difference + most, 1.0))
    counts = [_weight(x) * x.count for x in hits]
    shares = [(n * x.mean + 1) / (n + 2) for n, x in zip(counts, hits, strict=True)]
    error = math.sqrt(sum(p * (1 - p) / (n + 2) for p, n in zip(shares, counts, strict=True)))
    difference, middle = hits[0].mean - hits[1].mean, shares[0] - shares[1]
    lower, upper = np.clip([middle - _Z * error, middle + _Z * error], -1, 1)
    return Estimate(difference, min(float(lower), difference), max(float(upper), difference))


def _weight(x: Sample) -> float:
    """Return the number of independent realizations that determine the mean as well as one realization of a sample does.

    It is 1 if replicates do not differ, since that does not make a share certain.
    """
    widening = x.widening
    return 1 / widening**2 if widening > 0 else 1.0


def variance_from_moments(count: int, moment2: ArrayLike, moment4: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return variances from the second and the fourth central moment of samples, arrays of any shape.

    The intervals are Bonett's (2006): on the log scale, with standard errors from the fourth moment. The smallest samples have
    none.
    """
    moment2, moment4 = np.asarray(moment2), np.asarray(moment4)
    with np.errstate(invalid="ignore", divide="ignore"):
        kurtosis = np.where(moment2 > 0, moment4 / moment2**2, 1.0)
    correction = count / (count - _Z)
    error = correction * np.sqrt(np.maximum(kurtosis - 1 + 3 / count, 0) / (count - 1))
    estimate = moment2 * count / (count - 1)
    middle = correction * estimate
    if count < MIN_VARIANCE:
        return estimate, np.full(estimate.shape, np.nan), np.full(estimate.shape, np.nan)
    return estimate, np.minimum(middle * np.exp(-_Z * error), estimate), middle * np.exp(_Z * error)


def hypotenuse(one: float, other: float, correlation: float) -> float:
    """Return the distance of a bound from an estimate that depends on two others (Zou and Donner, 2008).

    The distances of their bounds, `one` and `other`, add up like errors.
    """
    return math.sqrt(max(one**2 + other**2 + 2 * correlation * abs(one * other), 0.0))


def effective_count(squares: np.ndarray) -> float:
    """Return how many equal terms determine a sum as well as `squares` (realization,) do; 0 if all are 0."""
    return float(squares.sum() ** 2 / (squares**2).sum()) if squares.any() else 0.0


def is_constant(x: Sample, accuracy: float = 0.0) -> bool:
    """Return whether the spread of a sample may be due to rounding, or to a solver with a finite accuracy."""
    return not x.moments[0] > max(8 * np.finfo(float).eps * abs(x.mean), accuracy, x.accuracy) ** 2


def binomial_quantile(q: ArrayLike, n: ArrayLike, p: float) -> np.ndarray:
    """Return the least numbers of hits among `n` trials of probability p that are not exceeded with probability `q`."""
    n, trials = np.asarray(n), np.maximum(n, 1)
    k = np.maximum(np.ceil(np.nan_to_num(special.bdtrik(q, trials, p))), 0).astype(np.int64)
    k -= (k > 0) & (special.bdtr(np.maximum(k - 1, 0), trials, p) >= q)
    return np.where(n > 0, np.minimum(k, n), 0)
