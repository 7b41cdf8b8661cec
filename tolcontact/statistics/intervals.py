"""Estimates from a Monte-Carlo sample with 95 % confidence intervals.

Every function takes a sample (realization,) and returns (estimate, lower, upper). No interval assumes a normal
distribution: contact cuts distributions off.
"""

import numpy as np
from scipy import special

CONFIDENCE = 0.95
Estimate = tuple[float, float, float]

_LOWER, _UPPER = 0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2
_Z = float(special.ndtri(_UPPER))


def mean(x: np.ndarray) -> Estimate:
    """Mean, Student's t interval."""
    centre = float(x.mean())
    half = float(special.stdtrit(len(x) - 1, _UPPER) * x.std(ddof=1) / np.sqrt(len(x)))
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
    below, above = (_binomial_quantile(q, n, p) for q in (_LOWER, _UPPER))
    lower = ordered[below - 1] if below >= 1 else -np.inf
    upper = ordered[above] if above < n else np.inf
    return float(np.quantile(x, p)), float(lower), float(upper)


def share(hits: np.ndarray) -> Estimate:
    """Share of True in a sample of booleans, exact (Clopper-Pearson) interval."""
    k, n = int(hits.sum()), len(hits)
    lower = special.betaincinv(k, n - k + 1, _LOWER) if k > 0 else 0.0
    upper = special.betaincinv(k + 1, n - k, _UPPER) if k < n else 1.0
    return k / n, float(lower), float(upper)


def variance_ratio(after: np.ndarray, before: np.ndarray) -> Estimate:
    """Variance of `after` over variance of `before`, from the same realizations (paired, on the log scale)."""
    if before.var() == 0 or after.var() == 0:
        return (float("nan"),) * 3
    ratio = float(after.var(ddof=1) / before.var(ddof=1))
    factor = np.exp(_Z * _standard_error(_variance_influence(after) - _variance_influence(before)))
    return ratio, float(ratio / factor), float(ratio * factor)


def _binomial_quantile(q: float, n: int, p: float) -> int:
    """The least number of hits among n, each of probability p, that is not exceeded with probability `q`."""
    k = max(int(np.ceil(special.bdtrik(q, n, p))), 0)
    return k - 1 if k > 0 and special.bdtr(k - 1, n, p) >= q else k


def _variance_influence(x: np.ndarray) -> np.ndarray:
    """What each realization adds to the logarithm of the variance."""
    deviation2 = (x - x.mean()) ** 2
    return np.asarray(deviation2 / deviation2.mean() - 1)


def _standard_error(influence: np.ndarray) -> float:
    return float(influence.std(ddof=1) / np.sqrt(len(influence)))
