"""Differences of two samples with 95 % intervals, for samples of the same realizations (paired) or of different ones.

Realization k of both samples forms a pair. Pairs are independent of each other whether or not their two members are, so paired
intervals hold for any two runs with the same number of realizations; equal draws make them narrow. In runs with a sampling plan
the replicates are independent, and their differences determine the width of intervals (see Sample.widening).
"""

import math

import numpy as np
from scipy import special

from tolcontact.statistics import intervals
from tolcontact.statistics.intervals import UNDEFINED, Estimate
from tolcontact.statistics.sample import Sample

_Z = float(special.ndtri(0.5 + intervals.CONFIDENCE / 2))


def shift(sample: Sample, baseline: Sample, *, paired: bool) -> Estimate:
    """Return the difference of the means: Student's t of paired differences, or Welch's interval."""
    if paired:
        return intervals.mean(sample - baseline)
    squared_errors = [x.moments[0] / (x.count - 1) * x.widening**2 for x in (sample, baseline)]
    difference, total = sample.mean - baseline.mean, sum(squared_errors)
    if not (sample.determines_moments and baseline.determines_moments):
        return Estimate(difference, math.nan, math.nan)
    if not total > 0:
        return Estimate(difference, difference, difference) if math.isfinite(difference) else UNDEFINED
    freedom = total**2 / sum(error**2 / (x.count - 1) for error, x in zip(squared_errors, (sample, baseline), strict=True))
    half = intervals.student(freedom) * math.sqrt(total)
    return Estimate(difference, difference - half, difference + half)


def variance_ratio(sample: Sample, baseline: Sample, *, paired: bool) -> Estimate:
    """Return the ratio of the variances; if not paired, from the intervals of both on the log scale (Zou and Donner, 2008).

    If the lower bound of the second variance is 0, the ratio has no upper bound.
    """
    if paired:
        return intervals.variance_ratio(sample, baseline)
    if intervals.is_constant(sample) or intervals.is_constant(baseline):
        return UNDEFINED
    variances = [intervals.variance(x) for x in (sample, baseline)]
    (value, lower, upper), (base, base_lower, base_upper) = np.array(variances)
    with np.errstate(divide="ignore"):
        below, above = np.hypot(np.log([value / lower, upper / value]), np.log([base_upper / base, base / base_lower]))
    return Estimate(value / base, float(value / base * np.exp(-below)), float(value / base * np.exp(above)))


def share_shift(sample: Sample, baseline: Sample, *, paired: bool) -> Estimate:
    """Return the difference of two shares, from samples of booleans.

    If the samples are paired, the distances of the exact bounds of the shares that are gained and lost add up like errors
    (Zou and Donner, 2008); both shares are correlated. If not, the interval is Wald's after one hit and one miss more in each
    sample (Agresti and Caffo, 2000).
    """
    if paired:
        change = sample.map(lambda values: values.astype(float)) - baseline.map(lambda values: values.astype(float))
        weight = _weight(change)
        n = weight * change.count
        counts = [weight * int((change.values == sign).sum()) for sign in (1, -1)]
        gained, lost = (intervals.proportion_of(count, n) for count in counts)
        odds = math.prod(share.value / (1 - share.value) for share in (gained, lost) if share.value < 1)
        least = intervals.hypotenuse(gained.value - gained.lower, lost.upper - lost.value, math.sqrt(odds))
        most = intervals.hypotenuse(gained.upper - gained.value, lost.value - lost.lower, math.sqrt(odds))
        difference = gained.value - lost.value
        return Estimate(difference, max(difference - least, -1.0), min(difference + most, 1.0))
    hits = [x.map(lambda values: values.astype(float)) for x in (sample, baseline)]
    weights = [_weight(x) for x in hits]
    counts = [weight * x.count for weight, x in zip(weights, hits, strict=True)]
    shares = [(n * x.mean + 1) / (n + 2) for n, x in zip(counts, hits, strict=True)]
    error = math.sqrt(sum(p * (1 - p) / (n + 2) for p, n in zip(shares, counts, strict=True)))
    return _bounded(hits[0].mean - hits[1].mean, shares[0] - shares[1], error)


def _weight(x: Sample) -> float:
    """Return the number of independent realizations that determine the mean as well as one realization of a sample does.

    It is 1 if replicates do not differ, since that does not make a share certain.
    """
    widening = x.widening
    return 1 / widening**2 if widening > 0 else 1.0


def _bounded(estimate: float, middle: float, error: float) -> Estimate:
    """Return an estimate with the interval of a normal distribution, clipped to -1 and 1."""
    lower, upper = np.clip([middle - _Z * error, middle + _Z * error], -1, 1)
    return Estimate(estimate, min(float(lower), estimate), max(float(upper), estimate))
