"""Answers of tolcontact: runs, and estimates with intervals that cover 99.9 % of runs."""

from __future__ import annotations  # references.py reads this module without tolcontact

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

import tolcontact as tc

SEED = 1
Z = float(stats.norm.ppf(0.9995))
Z_OF_ANALYSES = float(stats.norm.ppf(0.975))


class Estimate(NamedTuple):
    """A computed value with its bounds: an interval, or the value and a tolerance."""

    value: float
    lower: float
    upper: float


class Answers(NamedTuple):
    """An estimate for each quantity of a problem, and the number of realizations simulated."""

    estimates: Sequence[Estimate]
    realizations: int


def simulated(model: tc.Assembly, samples: int, **options: Any) -> Any:
    """Return a run that keeps measures only."""
    settings: dict[str, Any] = {"seed": SEED, "solver": "daqp", "keep": "measures", "fields": "none", "surfaces": 0}
    return tc.run(model, samples=samples, **(settings | options))


def values(results: Any, measure: str, state: str = "corrected") -> np.ndarray:
    """Return the values (realization,) of a measure."""
    return np.asarray(results.measured.sel(measure=measure, state=state).values)


def not_assembled(results: Any) -> np.ndarray:
    """Return whether parts could not be assembled, (realization,)."""
    return np.asarray(results.status.values == tc.Status.NOT_ASSEMBLABLE)


def mean(x: np.ndarray) -> Estimate:
    """Return the mean of a sample."""
    half = Z * x.std(ddof=1) / np.sqrt(len(x))
    return Estimate(x.mean(), x.mean() - half, x.mean() + half)


def variance(x: np.ndarray) -> Estimate:
    """Return the variance of a sample; its interval follows from the fourth moment."""
    value = x.var(ddof=1)
    half = Z * np.sqrt((((x - x.mean()) ** 2 - value) ** 2).mean() / len(x))
    return Estimate(value, value - half, value + half)


def deviation(x: np.ndarray) -> Estimate:
    """Return the standard deviation of a sample."""
    return Estimate(*np.sqrt(variance(x)))


def skewness(x: np.ndarray) -> Estimate:
    """Return the skewness of a sample; its interval follows from the influence of each realization (delta method)."""
    z = (x - x.mean()) / x.std()
    value = (z**3).mean()
    half = Z * (z**3 - 3 * z - 1.5 * value * (z**2 - 1)).std() / np.sqrt(len(x))
    return Estimate(value, value - half, value + half)


def quantile(x: np.ndarray, p: float) -> Estimate:
    """Return a quantile of a sample; its interval is between order statistics."""
    half = Z * np.sqrt(p * (1 - p) / len(x))
    return Estimate(*map(float, np.quantile(x, [p, p - half, p + half])))


def share(hits: np.ndarray) -> Estimate:
    """Return the share of True, with the exact interval."""
    interval = stats.binomtest(int(hits.sum()), len(hits)).proportion_ci(0.999)
    return Estimate(float(hits.mean()), interval.low, interval.high)


def within(value: float, tolerance: float) -> Estimate:
    """Return a value that is no estimate of a sample, with its tolerance."""
    return Estimate(float(value), float(value) - tolerance, float(value) + tolerance)


def critical_friction(model: tc.Assembly, seat: str) -> Estimate:
    """Return the least coefficient of friction that can hold a part short of a seat."""
    return within(float(tc.analyses.seating(model).critical.sel(seat=seat)), 1e-6)


def of_analysis(estimate: Any) -> Estimate:
    """Return an estimate (interval,) of an analysis, its 95 % interval widened to 99.9 %."""
    value, lower, upper = map(float, estimate.values)
    times = Z / Z_OF_ANALYSES
    return Estimate(value, value - times * (value - lower), value + times * (upper - value))


def of_tails(model: tc.Assembly, event: str, samples: int, **method: Any) -> Answers:
    """Return the probability of a rare event, its 95 % interval widened to 99.9 % in logarithms."""
    tails = tc.analyses.tails(model, samples=samples, seed=SEED, solver="daqp", method=method or None).sel(event=event)
    value, lower, upper = np.log(np.maximum(tails.probability.values, 1e-300))
    times = Z / Z_OF_ANALYSES
    bounds = value, value - times * (value - lower), value + times * (upper - value)
    return Answers([Estimate(*map(float, np.exp(bounds)))], int(tails.simulated))
