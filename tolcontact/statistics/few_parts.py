"""What few measured parts leave open about a result: posterior draws of contributors, as weights of realizations.

A supplier states a mean m and a standard deviation s of n parts, from a normal distribution. With the prior 1 / sigma, whose
intervals of mean, sigma and any quantile have their coverage exactly, the posterior is

    sigma^2 = (n - 1) s^2 / chi^2(n - 1),     mu = m + sigma N(0, 1) / n^(1/2).

A `world` is one draw of all means and sigmas. The realizations of the run, drawn at m and s, have the density of another world
with weights. A measurement y depends on these contributors through t = b.x, with its least-squares slopes b, which is normal in
each world; a realization has the ratio of the two densities of t as its weight. One number decides, whatever the number of
contributors, so that weights stay near 1. They are exact for one contributor and for linear measurements, and a value kept by
contact stays where it is. Beyond the largest value of the run there is nothing to weigh: where few realizations are beyond
a limit, y is also moved along b, and the larger share bounds the interval.

Measured rows of a population are weighted by a flat Dirichlet distribution (Rubin, The Bayesian Bootstrap, 1981), which assumes
no shape. Parts that were not measured are one more row of that distribution, outside of all limits in upper bounds of shares,
and inside in lower ones: with one population this is the interval of Clopper and Pearson for that many parts. Where lots are
drawn first, the weights of lots are drawn, too, and the parts not measured are lots.

The spread over the worlds adds to the interval of the run like an independent error, on the log scale for spreads. The mean of
n rows varies over the worlds by s ((n - 1) / (n (n + 1)))^(1/2) only, and about normally: intervals are stretched so that it
has Student's, t s / n^(1/2).
"""

import math
from collections.abc import Iterator, Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np
import scipy
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.limits import Limits
from tolcontact.realizations import column, declaration_of, is_assembled, statuses
from tolcontact.statistics import capability
from tolcontact.statistics.intervals import CONFIDENCE
from tolcontact.statistics.measure_statistics import MIN_VALUES, STATISTICS, MeasuredValues, limits
from tolcontact.statistics.measured_rows import MeasuredRows, measured_rows, sources
from tolcontact.statistics.variance_shares import required_realizations

WORLDS = 512  # a power of 2: the points of a Sobol' sequence
MAX_WEIGHTS = 1 << 20  # in memory
MIN_UNIFORM = 1e-9
MAX_FITTED = 20_000  # realizations that slopes are fitted to
NEGLIGIBLE = 1e-6  # of the largest effect of a contributor
FEW_BEYOND = 100  # realizations beyond a limit: with fewer, values are also moved
POSITIVE = terms.STANDARD_DEVIATION, terms.SIX_SIGMA, terms.VARIANCE, terms.PP, terms.PP_NORMAL  # on the log scale
LOCATIONS = terms.MEAN, terms.SHIFT
MIN_ROWS = 10  # of a population: fewer know too little of its spread; 6 sigma would be covered in 60 % of cases with four
NAMES = list(STATISTICS)
BOUNDS = [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2]


class Worlds:
    """Posterior draws for contributors that are known from few parts.

    deviations   (realization, contributor) of all that varies, without what shared causes add to it
    parts        (contributor,) number of parts behind a mean and a standard deviation; 0 if these are known
    populations  measured rows
    luck         (world,) numbers between 0 and 1 for the error of the run itself
    sources      (contributor + population,) numbers of what each is known from: equal sources have the same draws in all runs
                 that have them, and other sources independent ones; None draws all of a run together, which spreads them better
                 (the attribute is the set of the numbers that belong to few parts)
    has_rows     whether there are populations
    """

    def __init__(
        self,
        deviations: np.ndarray,
        parts: np.ndarray,
        populations: Sequence[MeasuredRows] = (),
        sources: Sequence[int] | None = None,
    ) -> None:
        rng = np.random.default_rng(0)
        self._x, self._columns, self._populations = deviations, np.flatnonzero(parts), populations
        n, x = parts[self._columns], deviations[:, self._columns]
        u = scipy.stats.qmc.Sobol(2 * len(n) + 2, rng=rng).random(WORLDS).clip(MIN_UNIFORM, 1 - MIN_UNIFORM)
        generators = [rng] * len(populations) if sources is None else [*map(np.random.default_rng, sources[len(parts) :])]
        if sources is not None:
            for k, column in enumerate(self._columns.tolist()):
                u[:, [2 + k, 2 + len(n) + k]] = _latin_hypercube(np.random.default_rng(sources[column]))
        scale = np.sqrt((n - 1) / scipy.special.chdtri(n - 1, u[:, 2 : 2 + len(n)]))
        self._means, self._spreads = x.mean(axis=0), x.std(axis=0)
        self._mean_changes = self._spreads * scale * scipy.special.ndtri(u[:, 2 + len(n) :]) / np.sqrt(n)
        self._scale = scale
        self._correlation = np.atleast_2d(np.corrcoef(x.T)) if len(n) else np.zeros((0, 0))
        self._row_weights = [rows.weights(r, WORLDS) for rows, r in zip(populations, generators, strict=True)]
        self.luck, self._unseen = u[:, 0], u[:, 1]
        self.has_rows = bool(populations)
        few = range(len(parts), len(sources)) if sources is not None else ()
        self.sources = frozenset(sources[k] for k in (*self._columns, *few)) if sources is not None else frozenset[int]()

    @property
    def moves(self) -> bool:
        """Whether values can be moved: contributors have a distribution, and not measured rows alone."""
        return bool(len(self._columns))

    def fewest(self, index: "Index") -> float:
        """Return the number of parts, or lots, in the smallest population that a measurement depends on; infinite for none."""
        return min((rows.known for rows in compress(self._populations, index.depends)), default=math.inf)

    def unseen(self, index: "Index") -> np.ndarray:
        """Return the share (world,) of parts not measured, in the smallest population that a measurement depends on."""
        return np.asarray(-np.expm1(np.log(self._unseen) / self.fewest(index)))  # quantiles of a beta distribution

    def stretch(self, index: "Index", name: str) -> float:
        """Return how many times wider the interval of a statistic or change is than its spread over the worlds.

        It is 1 without measured rows, and NaN for what has no interval: of few rows all but the mean.
        """
        if math.isinf(n := self.fewest(index)):
            return 1.0
        if n < MIN_ROWS and name not in LOCATIONS:
            return math.nan
        return float(scipy.stats.t.ppf(BOUNDS[1], n - 1) / scipy.stats.norm.ppf(BOUNDS[1]) * math.sqrt((n + 1) / (n - 1)))

    def index(self, y: np.ndarray) -> "Index":
        """Return the index of a measurement y (realization,) in all worlds; values that are NaN do not count."""
        rows = np.flatnonzero(np.isfinite(y[:MAX_FITTED]))
        fitted = np.flatnonzero(np.ptp(self._x[:MAX_FITTED], axis=0) > 0)
        measured = [rows.columns for rows in self._populations]
        if len(rows) < required_realizations(len(fitted)):
            fitted = np.unique(np.concatenate([self._columns, *measured]))
        x = self._x[np.ix_(rows, fitted)]
        slopes = np.zeros(self._x.shape[1])
        if len(fitted) and len(rows):
            slopes[fitted] = np.linalg.lstsq(x - x.mean(axis=0), y[rows] - y[rows].mean(), rcond=1e-10)[0]
        effects = np.abs(slopes) * self._x.std(axis=0)
        depends = [bool(effects[columns].max() > NEGLIGIBLE * effects.max()) for columns in measured]
        slopes = slopes[self._columns]
        t = (self._x[:, self._columns] - self._means) @ slopes
        deviations = slopes * self._spreads * self._scale
        variances = np.einsum("wi,ij,wj->w", deviations, self._correlation, deviations)
        return Index(t, float(t.std()), self._mean_changes @ slopes, np.sqrt(variances), depends)

    def weights(self, index: "Index") -> Iterator[np.ndarray]:
        """Yield weights (world, realization) of some worlds after another; each world has a sum of 1."""
        for start in range(0, WORLDS, count := max(MAX_WEIGHTS // len(index.t), 1)):
            worlds = np.arange(start, min(start + count, WORLDS))
            weights = index.weights(worlds)
            for rows, row_weights in compress(zip(self._populations, self._row_weights, strict=True), index.depends):
                weights *= row_weights[worlds][:, rows.of_realization]
            yield weights / weights.sum(axis=1, keepdims=True)


def _latin_hypercube(rng: np.random.Generator) -> np.ndarray:
    """Return points (world, 2) in the unit square."""
    return (rng.permuted(np.tile(np.arange(WORLDS), (2, 1)), axis=1).T + rng.random((WORLDS, 2))) / WORLDS


class Index(NamedTuple):
    """The contributors of few parts in one number, as a measurement depends on them.

    t        (realization,) of the run, about its mean
    spread   its standard deviation
    means    (world,)
    spreads  (world,) its standard deviations
    depends  (population,) whether the measurement depends on these measured rows
    """

    t: np.ndarray
    spread: float
    means: np.ndarray
    spreads: np.ndarray
    depends: list[bool]

    def weights(self, worlds: np.ndarray) -> np.ndarray:
        """Return the ratios (world, realization) of the densities of t in worlds and in the run."""
        if not self.spread > 0:
            return np.ones((len(worlds), len(self.t)))
        mean, spread = self.means[worlds, None], self.spreads[worlds, None]
        return np.asarray(np.exp(((self.t / self.spread) ** 2 - ((self.t - mean) / spread) ** 2) / 2) * self.spread / spread)

    def moved(self, world: int) -> np.ndarray:
        """Return the changes (realization,) of a linear measurement in a world."""
        growth = self.spreads[world] / self.spread - 1 if self.spread > 0 else 0.0
        return np.asarray(self.means[world] + growth * self.t)


def has_few_parts(results: xr.DataTree) -> bool:
    """Return whether a contributor is known from few parts, or from a population."""
    return bool(_parts(results["sample"].to_dataset()).any() or declaration_of(results).get("populations"))


def _parts(sample: xr.Dataset) -> np.ndarray:
    """Return the number of parts behind each contributor, (contributor,)."""
    return sample[terms.PARTS.name].values if terms.PARTS.name in sample else np.zeros(sample.sizes[terms.CONTRIBUTOR], int)


def worlds_of(results: xr.DataTree, count: int, *, by_source: bool = False) -> Worlds | None:
    """Return the posterior draws for `count` realizations; None if nothing was measured, or no deviations are kept.

    With `by_source`, what has the same declaration in several runs has the same draws there (see Worlds).
    """
    sample, document = results["sample"].to_dataset(), declaration_of(results)
    if not has_few_parts(results) or terms.DEVIATION.name not in sample:
        return None
    labels, parts = [str(label) for label in sample[terms.CONTRIBUTOR].values], _parts(sample)
    x = sample[terms.DEVIATION.name].values[:count].copy()
    driven = x.copy()
    for variable in document.get("variables", []):
        for label, factor in variable["drives"].items():
            x[:, labels.index(label)] -= factor * driven[:, labels.index(variable["name"])]
    declared = document.get("populations", [])
    numbers = sources(document, labels) if by_source else None
    return Worlds(x, parts, [measured_rows(population, labels, x) for population in declared], numbers)


def with_few_parts(
    rows: xr.Dataset, worlds: Worlds, statistics: np.ndarray, changes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return statistics (measure, state, statistic, interval) and changes with the intervals that few parts add to."""
    statistics, changes = statistics.copy(), changes.copy()
    exists = is_assembled(statuses(rows))
    for number, of_measure in enumerate(limits(rows)):
        drawn, indices = list[np.ndarray](), list[Index]()
        for k, state in enumerate(terms.STATES):
            y = column(rows, terms.MEASURED, state=k, measure=number)
            y = np.where(np.isfinite(y) & (exists | (state == terms.STATES[terms.RAW])), y, np.nan)
            if np.isfinite(y).sum() >= MIN_VALUES:
                kept = capability.without_stops(MeasuredValues(rows, number, state, of_measure).sample, of_measure)
                indices.append(worlds.index(y))
                statistics[number, k], draws = widened(worlds, indices[-1], y, of_measure, kept, statistics[number, k])
                drawn.append(draws)
        if len(drawn) == len(terms.STATES):
            raw, corrected = drawn
            ratio = corrected[:, NAMES.index(terms.SIX_SIGMA)] / raw[:, NAMES.index(terms.SIX_SIGMA)]
            of_change = {terms.SHIFT: corrected[:, 0] - raw[:, 0], terms.SPREAD_RATIO: ratio, terms.VARIANCE_RATIO: ratio**2}
            for estimate, name in zip(changes[number], terms.CHANGES, strict=True):
                stretch = float(np.max([worlds.stretch(index, name) for index in indices]))  # NaN if one is
                estimate[1:] = joined(estimate, of_change[name], stretch, is_positive=name != terms.SHIFT)
    return statistics, changes


def widened(
    worlds: Worlds, index: Index, y: np.ndarray, of_measure: Limits, kept: Limits, estimates: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return `STATISTICS` with wider intervals, and draws of them.

    index, y    of a measure: values (realization,), NaN where there are none
    of_measure  its limits; `kept` are those without stops
    estimates   (statistic, interval) from the realizations alone
    """
    drawn, bounds = _draws(worlds, index, y, of_measure, kept)
    estimates = estimates.copy()
    for name, estimate, draws in zip(NAMES, estimates, drawn.T, strict=True):
        if name in terms.SHARES:
            lower, upper = bounds[:, terms.SHARES.index(name)]
            estimate[1:] = np.minimum(estimate[1], lower), np.maximum(estimate[2], upper)
        else:
            estimate[1:] = joined(estimate, draws, worlds.stretch(index, name), is_positive=name in POSITIVE)
    return estimates, drawn


def joined(estimate: np.ndarray, drawn: np.ndarray, stretch: float, *, is_positive: bool) -> np.ndarray:
    """Return the bounds of an estimate (value, lower, upper), with draws (world,) as an independent error on either side.

    stretch   how many times wider the interval is than the spread of the draws; NaN: there is no interval
    """
    if math.isnan(stretch):
        return np.full(2, np.nan)
    drawn = drawn[np.isfinite(drawn)]
    if not (len(drawn) and np.isfinite(estimate).all()) or (is_positive and not (estimate[1] > 0 and drawn.min() > 0)):
        return estimate[1:]
    value, *bounds = np.log(estimate) if is_positive else estimate
    ends = np.quantile(np.log(drawn) if is_positive else drawn, BOUNDS)
    lower = value - math.hypot(value - bounds[0], stretch * max(value - ends[0], 0.0))
    upper = value + math.hypot(bounds[1] - value, stretch * max(ends[1] - value, 0.0))
    return np.exp([lower, upper]) if is_positive else np.array([lower, upper])


def _draws(worlds: Worlds, index: Index, y: np.ndarray, of_measure: Limits, kept: Limits) -> tuple[np.ndarray, np.ndarray]:
    """Return statistics (world, statistic) of values y (realization,), NaN if they do not exist, and bounds (2, share)."""
    order = np.argsort(y)[: int(np.isfinite(y).sum())]  # NaN come last
    parts = [(weighted(y[order], w[:, order], of_measure, kept), 1 / (w**2).sum(axis=1)) for w in worlds.weights(index)]
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


def weighted(y: np.ndarray, weights: np.ndarray, of_measure: Limits, kept: Limits) -> np.ndarray:
    """Return the `STATISTICS` (world, statistic) of ascending values y (realization,) for weights (world, realization).

    The sum of weights is below 1 if other realizations have no value.
    """
    total, cumulative = weights.sum(axis=1), np.cumsum(weights, axis=1)
    centre, scale = y.mean(), y.std() or 1.0
    z = (y - centre) / scale
    first, second, third, fourth = (weights @ np.stack([z, z**2, z**3, z**4], axis=1) / total[:, None]).T
    variance = np.maximum(second - first**2, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        skewness = (third - 3 * first * second + 2 * first**3) / variance**1.5
        kurtosis = (fourth - 4 * first * third + 6 * first**2 * second - 3 * first**4) / variance**2
    mean, sigma = centre + scale * first, scale * np.sqrt(variance)
    ranks = [np.searchsorted(row, row[-1] * np.array(terms.PERCENTILES) / 100) for row in cumulative]
    percentiles = y[np.array(ranks).clip(0, len(z) - 1)].T
    below, above = (weights[:, side(y)].sum(axis=1) for side in (of_measure.below, of_measure.above))
    columns = [mean, sigma, 6 * sigma, sigma**2, *percentiles, skewness, kurtosis, below, above, below + above + 1 - total]
    for low, middle, high in (percentiles[[0, 2, 4]], (mean - 3 * sigma, mean, mean + 3 * sigma)):
        with np.errstate(divide="ignore", invalid="ignore"):
            sides = np.stack([(middle - kept.lower) / (middle - low), (kept.upper - middle) / (high - middle)])
            columns += [(kept.upper - kept.lower) / (high - low), np.fmin.reduce(np.where(np.isfinite(sides), sides, np.nan))]
    return np.stack(columns, axis=1)


def _moved_counts(y: np.ndarray, changes: np.ndarray, kept: Limits, missing: int) -> list[int]:
    """Return how many values are below, above and outside of limits as they change; there are `missing` ones more outside."""
    below, above = int(kept.below(y + changes).sum()), int(kept.above(y + changes).sum())
    return [below, above, below + above + missing]


def _share_draws(luck: np.ndarray, shares: np.ndarray, count: np.ndarray | int) -> np.ndarray:
    """Return draws of shares that were counted among a number of realizations (Jeffreys prior)."""
    shares = shares.clip(0, 1)
    return np.asarray(scipy.special.betaincinv(shares * count + 0.5, (1 - shares) * count + 0.5, luck[:, None]))
