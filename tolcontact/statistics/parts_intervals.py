"""Intervals of measures that include what few measured parts leave open (see few_parts)."""

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import special

from tolcontact import vocabulary as terms
from tolcontact.limits import Limits
from tolcontact.realizations import column, is_assembled, statuses
from tolcontact.statistics import capability
from tolcontact.statistics.few_parts import BOUNDS, FEW_BEYOND, WORLDS, Worlds
from tolcontact.statistics.measure_statistics import MIN_VALUES, STATISTICS, MeasuredValues, limits

POSITIVE = terms.STANDARD_DEVIATION, terms.SIX_SIGMA, terms.VARIANCE, terms.PP, terms.PP_NORMAL  # on the log scale
NAMES = list(STATISTICS)


@dataclass(frozen=True, eq=False)
class WeightedValues:
    """The values (realization,) of a measure in ascending order, for statistics by weights in that order.

    limits    of the measure
    capable   the same limits without stops
    """

    values: np.ndarray
    limits: Limits
    capable: Limits

    def statistics(self, weights: np.ndarray) -> np.ndarray:
        """Return the `STATISTICS` (world, statistic) for weights (world, realization).

        The sum of weights is below 1 if other realizations have no value.
        """
        total, cumulative = weights.sum(axis=1), np.cumsum(weights, axis=1)
        centre, scale = self.values.mean(), self.values.std() or 1.0
        z = (self.values - centre) / scale
        first, second, third, fourth = (weights @ np.stack([z, z**2, z**3, z**4], axis=1) / total[:, None]).T
        variance = np.maximum(second - first**2, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            skewness = (third - 3 * first * second + 2 * first**3) / variance**1.5
            kurtosis = (fourth - 4 * first * third + 6 * first**2 * second - 3 * first**4) / variance**2
        mean, sigma = centre + scale * first, scale * np.sqrt(variance)
        ranks = [np.searchsorted(row, row[-1] * np.array(terms.PERCENTILES) / 100) for row in cumulative]
        percentiles = self.values[np.array(ranks).clip(0, len(z) - 1)].T
        below, above = (weights[:, side(self.values)].sum(axis=1) for side in (self.limits.below, self.limits.above))
        columns = [mean, sigma, 6 * sigma, sigma**2, *percentiles, skewness, kurtosis, below, above, below + above + 1 - total]
        columns += self._capability(*percentiles[[0, 2, 4]]) + self._capability(mean - 3 * sigma, mean, mean + 3 * sigma)
        return np.stack(columns, axis=1)

    def _capability(self, low: np.ndarray, middle: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
        lower, upper, _ = self.capable
        with np.errstate(divide="ignore", invalid="ignore"):
            sides = np.stack([(middle - lower) / (middle - low), (upper - middle) / (high - middle)])
            pp = (upper - lower) / (high - low)
        return [pp, np.fmin.reduce(np.where(np.isfinite(sides), sides, np.nan))]


def with_few_parts(
    rows: xr.Dataset, worlds: Worlds, statistics: np.ndarray, changes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return statistics (measure, state, statistic, interval) and changes with the intervals that few parts add to."""
    statistics, changes = statistics.copy(), changes.copy()
    exists = is_assembled(statuses(rows))
    for number, of_measure in enumerate(limits(rows)):
        drawn = []
        for k, state in enumerate(terms.STATES):
            y = column(rows, terms.MEASURED, state=k, measure=number)
            y = np.where(np.isfinite(y) & (exists | (state == terms.STATES[terms.RAW])), y, np.nan)
            if np.isfinite(y).sum() >= MIN_VALUES:
                kept = capability.without_stops(MeasuredValues(rows, number, state, of_measure).sample, of_measure)
                statistics[number, k], draws = widened(worlds, y, of_measure, kept, statistics[number, k])
                drawn.append(draws)
        if len(drawn) == len(terms.STATES):
            raw, corrected = drawn
            ratio = corrected[:, NAMES.index(terms.SIX_SIGMA)] / raw[:, NAMES.index(terms.SIX_SIGMA)]
            of_change = {terms.SHIFT: corrected[:, 0] - raw[:, 0], terms.SPREAD_RATIO: ratio, terms.VARIANCE_RATIO: ratio**2}
            for estimate, name in zip(changes[number], terms.CHANGES, strict=True):
                estimate[1:] = _joined(estimate, of_change[name], is_positive=name != terms.SHIFT)
    return statistics, changes


def widened(
    worlds: Worlds, y: np.ndarray, of_measure: Limits, kept: Limits, estimates: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return `STATISTICS` with wider intervals, and draws of them.

    y           (realization,) values of a measure, NaN where there are none
    of_measure  its limits; `kept` are those without stops
    estimates   (statistic, interval) from the realizations alone
    """
    drawn, bounds = _draws(worlds, y, of_measure, kept)
    estimates = estimates.copy()
    for name, estimate, draws in zip(NAMES, estimates, drawn.T, strict=True):
        if name in terms.SHARES:
            lower, upper = bounds[:, terms.SHARES.index(name)]
            estimate[1:] = np.minimum(estimate[1], lower), np.maximum(estimate[2], upper)
        else:
            estimate[1:] = _joined(estimate, draws, is_positive=name in POSITIVE)
    return estimates, drawn


def _joined(estimate: np.ndarray, drawn: np.ndarray, *, is_positive: bool) -> np.ndarray:
    """Return the bounds of an estimate (value, lower, upper), with draws (world,) as an independent error on either side."""
    drawn = drawn[np.isfinite(drawn)]
    if not (len(drawn) and np.isfinite(estimate).all()) or (is_positive and not (estimate[1] > 0 and drawn.min() > 0)):
        return estimate[1:]
    value, *bounds = np.log(estimate) if is_positive else estimate
    ends = np.quantile(np.log(drawn) if is_positive else drawn, BOUNDS)
    lower = value - math.hypot(value - bounds[0], max(value - ends[0], 0.0))
    upper = value + math.hypot(bounds[1] - value, max(ends[1] - value, 0.0))
    return np.exp([lower, upper]) if is_positive else np.array([lower, upper])


def _draws(worlds: Worlds, y: np.ndarray, of_measure: Limits, kept: Limits) -> tuple[np.ndarray, np.ndarray]:
    """Return statistics (world, statistic) of values y (realization,), NaN if they do not exist, and bounds (2, share)."""
    order = np.argsort(y)[: int(np.isfinite(y).sum())]  # NaN come last
    weighted, index = WeightedValues(y[order], of_measure, kept), worlds.index(y)
    parts = [(weighted.statistics(w[:, order]), 1 / (w**2).sum(axis=1)) for w in worlds.weights(index)]
    drawn, effective = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    first = NAMES.index(terms.BELOW)
    shares = _share_draws(worlds.luck, drawn[:, first : first + len(terms.SHARES)], effective[:, None])
    # A limit that is a stop holds parts that were not measured, too.
    is_open = np.array([not np.isfinite(kept.lower), not np.isfinite(kept.upper), kept.are_open])
    unseen = np.where(is_open, 0.0, worlds.unseen(index)[:, None])
    lower, upper = np.quantile(shares * (1 - unseen), BOUNDS[0], axis=0), shares * (1 - unseen) + unseen
    bounds = np.stack([lower, np.quantile(upper, BOUNDS[1], axis=0)], axis=1)
    if worlds.moves:
        missing = len(y) - len(order)
        moved = np.array([_moved_counts(y[order], index.moved(world)[order], kept, missing) for world in range(WORLDS)])
        is_rare = (drawn[:, first : first + len(terms.SHARES)].mean(axis=0) * len(y) < FEW_BEYOND) & ~is_open
        of_moved = np.quantile(_share_draws(worlds.luck, moved / len(y), len(y)), BOUNDS[1], axis=0)
        bounds[is_rare, 1] = np.maximum(bounds[is_rare, 1], of_moved[is_rare])
    return drawn, bounds.T


def _moved_counts(y: np.ndarray, changes: np.ndarray, kept: Limits, missing: int) -> list[int]:
    """Return how many values are below, above and outside of limits as they change; there are `missing` ones more outside."""
    below, above = int(kept.below(y + changes).sum()), int(kept.above(y + changes).sum())
    return [below, above, below + above + missing]


def _share_draws(luck: np.ndarray, shares: np.ndarray, count: np.ndarray | int) -> np.ndarray:
    """Return draws of shares that were counted among a number of realizations (Jeffreys prior)."""
    shares = shares.clip(0, 1)
    return np.asarray(special.betaincinv(shares * count + 0.5, (1 - shares) * count + 0.5, luck[:, None]))
