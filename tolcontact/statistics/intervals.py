"""Estimates from a Monte-Carlo sample with 95 % confidence intervals.

Every function takes a sample (realization,) and returns (estimate, lower, upper). No interval assumes a normal
distribution: contact cuts distributions off.
"""

import numpy as np
from scipy import stats

CONFIDENCE = 0.95
Estimate = tuple[float, float, float]

_Z = float(stats.norm.ppf(0.5 + CONFIDENCE / 2))


def mean(x: np.ndarray) -> Estimate:
    """Mean, Student's t interval."""
    centre = float(x.mean())
    half = float(stats.t.ppf(0.5 + CONFIDENCE / 2, len(x) - 1) * x.std(ddof=1) / np.sqrt(len(x)))
    return centre, centre - half, centre + half


def variance(x: np.ndarray) -> Estimate:
    """Variance; interval on the log scale with the standard error that the fourth moment gives."""
    s2 = float(x.var(ddof=1))
    if s2 == 0:
        return 0.0, 0.0, 0.0
    factor = np.exp(_Z * _standard_error(_variance_influence(x)))
    return s2, float(s2 / factor), float(s2 * factor)


def standard_deviation(x: np.ndarray, *, times: float = 1.0) -> Estimate:
    """`times` the standard deviation: 6 gives 6 sigma. Interval from that of the variance."""
    s2, lower, upper = variance(x)
    return times * np.sqrt(s2), times * np.sqrt(lower), times * np.sqrt(upper)


def percentile(x: np.ndarray, percent: float) -> Estimate:
    """Percentile; the interval runs between order statistics (binomial, distribution-free).

    A bound is infinite where the sample is too small to have one.
    """
    ordered = np.sort(x)
    p, n = percent / 100, len(x)
    below, above = stats.binom.ppf([0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2], n, p).astype(int)
    lower = ordered[below - 1] if below >= 1 else -np.inf
    upper = ordered[above] if above < n else np.inf
    return float(np.quantile(x, p)), float(lower), float(upper)


def share(hits: np.ndarray) -> Estimate:
    """Share of True in a sample of booleans, exact (Clopper-Pearson) interval."""
    test = stats.binomtest(int(hits.sum()), len(hits))
    bounds = test.proportion_ci(CONFIDENCE, method="exact")
    return float(test.statistic), float(bounds.low), float(bounds.high)


def variance_ratio(after: np.ndarray, before: np.ndarray) -> Estimate:
    """Variance of `after` over variance of `before`, from the same realizations (paired, on the log scale)."""
    if before.var() == 0 or after.var() == 0:
        return (float("nan"),) * 3
    ratio = float(after.var(ddof=1) / before.var(ddof=1))
    factor = np.exp(_Z * _standard_error(_variance_influence(after) - _variance_influence(before)))
    return ratio, float(ratio / factor), float(ratio * factor)


def _variance_influence(x: np.ndarray) -> np.ndarray:
    """What each realization adds to the logarithm of the variance."""
    deviation2 = (x - x.mean()) ** 2
    return np.asarray(deviation2 / deviation2.mean() - 1)


def _standard_error(influence: np.ndarray) -> float:
    return float(influence.std(ddof=1) / np.sqrt(len(influence)))
