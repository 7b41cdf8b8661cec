"""Two searches for a rare event: by levels of its score, and by inflation of all contributors.

A search has several strands. They share its levels and are otherwise independent: their differences give the interval of the
product of shares that a search estimates. Realizations of all strands are simulated in one batch.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import special

from tolcontact.statistics import intervals
from tolcontact.statistics.intervals import Estimate

STRANDS = 8
SHARE = 0.2  # of each event, in the previous one
MIN_LEVEL = 10  # realizations of a strand at a level
MIN_SEEDS = 2  # per strand: smallest number of starts of walks to the next level
FIRST_STEP, ACCEPTANCE = 0.8, 0.4  # length of steps, and their target acceptance rate
MIN_STEP, MAX_STEP = 0.02, 0.99
MAX_LEVELS = 60
INFLATIONS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0)
COMMON, MIN_COMMON = 0.1, 0.01  # shares of realizations in the event that end inflation: at once; if none gives more
UNKNOWN_INFLATION = 3.0  # used where no inflation leads to the event
MAX_WEIGHTED = 10  # contributors: with more, the weights of inflation spread too far
MAX_VARIANCE = 1.0  # of weights, relative to the square of their mean
GOAL, MIN_GOAL = 0.25, 0.05  # share of an inflated event in the previous one: target, and smallest accepted
NESTED_SEEDS = 1 / 3  # of all realizations: fewer and larger calls of the score than with the share of hits
FIRST_PACE, MAX_CHANGE, TRIES = 0.05, 3.0, 6  # growth of 1 / s^2 from one inflated event to the next, and its adaptation
CHECKED_SHARE = 0.25  # share of realizations that are checked in the previous event
BISECTIONS = 30
NEGLIGIBLE = 1e-9  # probability below which a search ends
BEFORE_NESTED = 3.0  # realizations per position at a level, before the first nested event
MAX_REACH = 700.0  # largest logarithm

Score = Callable[[np.ndarray], np.ndarray]  # u (n, d) -> (n,)


class SearchResult(NamedTuple):
    """The result of a search: its estimate of the probability, and realizations of each strand in the event, (n, d)."""

    probability: Estimate
    points: list[np.ndarray]


class Product:
    """A product of means over strands, and its interval.

    The influence of a strand on the logarithm of the product is the sum of its relative deviations from the means. The sum is
    nearly normal even where the estimates of single strands, which are products themselves, are skewed.
    """

    def __init__(self) -> None:
        self.log = 0.0
        self._influence = np.zeros(STRANDS)

    def times(self, values: np.ndarray, log_scale: float = 0.0) -> None:
        """Multiply by the mean of values (strand,) times exp(`log_scale`)."""
        mean = values.mean()
        self.log += math.log(mean) + log_scale
        self._influence += values / mean - 1

    def over(self, hits: np.ndarray) -> None:
        """Divide by the share of hits (strand, n); if there are none, one hit is assumed."""
        if hits.size:
            mean = max(float(hits.mean()), 1 / hits.size)
            self.log -= math.log(mean)
            self._influence -= hits.mean(axis=1) / mean - 1

    @property
    def is_negligible(self) -> bool:
        """Whether the product so far, the probability of a level or of an inflated event, is negligible."""
        return self.log < math.log(NEGLIGIBLE)

    @property
    def estimate(self) -> Estimate:
        """The product with its 95 % interval (delta method on the logarithm, Student's t over the strands)."""
        error = float(self._influence.std(ddof=1)) / math.sqrt(STRANDS)
        reach = math.exp(min(intervals.student(STRANDS - 1) * error, MAX_REACH))
        value = math.exp(self.log)
        return Estimate(value, value / reach, min(value * reach, 1.0))

    @property
    def of_nothing(self) -> SearchResult:
        """The result of a search that did not find the event, or that ended because it was negligible.

        A level contains the event. An inflated event is assumed to be no less probable than the event itself.
        """
        return SearchResult(Estimate(0.0, 0.0, self.estimate.upper if self.is_negligible else 1.0), [])


class Walk:
    """Realizations of all strands that walk within events, simulated by `score`: `count` per strand at a level."""

    def __init__(self, score: Score, dimensions: int, count: int, rng: np.random.Generator) -> None:
        self._score, self.dimensions, self.count, self.rng = score, dimensions, count, rng
        self._simulated, self._step = 0, FIRST_STEP

    @property
    def seeds(self) -> int:
        """The number of realizations per strand that start walks to the next level."""
        return max(int((SHARE if self.dimensions <= MAX_WEIGHTED else NESTED_SEEDS) * self.count), MIN_SEEDS)

    def spread(self, budget: int, levels: float) -> None:
        """Choose the number of realizations at a level so that the remaining levels use up the rest of a budget."""
        self.count = max(int((budget - self._simulated) / STRANDS / levels), MIN_LEVEL)

    def scores(self, u: np.ndarray) -> np.ndarray:
        """Return the scores (strand, n) of realizations u (strand, n, d)."""
        self._simulated += u.shape[0] * u.shape[1]
        return self._score(u.reshape(-1, self.dimensions)).reshape(u.shape[:2])

    def seed_positions(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the positions of the seeds (strand, seed) of the next level among realizations with weights (strand, n).

        A strand without any weight continues from the other strands.
        """
        strands, places = [], []
        for strand in range(STRANDS):
            available = np.zeros_like(weights)
            available[strand] = weights[strand]
            numbers = _resampled((available if available.any() else weights).ravel(), self.seeds, self.rng)
            source, place = np.divmod(numbers, weights.shape[1])
            strands.append(source)
            places.append(place)
        return np.array(strands), np.array(places)

    def advance(
        self, u: np.ndarray, g: np.ndarray, threshold: float, deviation: float = 1.0, stretch: float = 1.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return realizations of N(0, deviation^2) with scores above a threshold, by walks from u (strand, seed, d), and g.

        Scores are evaluated at realizations times `stretch`.
        """
        walked, scores = [], []
        for _ in range(math.ceil(self.count / self.seeds)):
            candidates = np.sqrt(1 - self._step**2) * u + self._step * deviation * self.rng.standard_normal(u.shape)
            candidate_scores = self.scores(stretch * candidates)
            is_accepted = candidate_scores > threshold
            u, g = np.where(is_accepted[..., None], candidates, u), np.where(is_accepted, candidate_scores, g)
            self._step = float(np.clip(self._step * np.exp(is_accepted.mean() - ACCEPTANCE), MIN_STEP, MAX_STEP))
            walked.append(u)
            scores.append(g)
        return np.concatenate(walked, axis=1), np.concatenate(scores, axis=1)


def by_levels(walk: Walk) -> SearchResult:
    """Search by levels of the score."""
    product = Product()
    u = _levels(walk, 1.0, product)
    return product.of_nothing if u is None else SearchResult(product.estimate, u)


def by_inflation(walk: Walk, inflation: float, budget: int) -> SearchResult:
    """Search from an inflation back to none; nested inflations use about `budget` realizations in all."""
    return _weighted(walk, inflation) if walk.dimensions <= MAX_WEIGHTED else _nested(walk, inflation, budget)


def nested_levels(inflation: float, share: float) -> float:
    """Return the approximate number of realizations of a nested search, in multiples of one level.

    share   of the event in realizations with this inflation. The event is approximated by a half-space, which has the
            probability Q(distance / s) at the inflation s.
    """
    distance = -inflation * special.ndtri(share)
    ratio = math.log(share) - max(float(special.log_ndtr(-distance)), math.log(NEGLIGIBLE))
    return (2 + CHECKED_SHARE) * (1 + max(ratio, 0.0) / -math.log(GOAL))


def first_inflation(score: Score, dimensions: int, count: int, rng: np.random.Generator) -> tuple[float, float]:
    """Return the least inflation at which the event is common, or else most common, from `count` realizations at each.

    The second number is the share of the event at the inflation, at least one realization.
    """
    scores = score(np.concatenate([s * rng.standard_normal((count, dimensions)) for s in INFLATIONS]))
    shares = [float((g > 0).mean()) for g in np.split(scores, len(INFLATIONS))]
    common = [(s, share) for s, share in zip(INFLATIONS, shares, strict=True) if share >= COMMON]
    if common:
        return common[0]
    best = int(np.argmax(shares))
    return (INFLATIONS[best] if shares[best] > MIN_COMMON else UNKNOWN_INFLATION), max(shares[best], 1 / count)


def _levels(walk: Walk, inflation: float, product: Product) -> list[np.ndarray] | None:
    """Return realizations of N(0, inflation^2) of each strand in the event; None if it is not found, or negligible."""
    u = inflation * walk.rng.standard_normal((STRANDS, walk.count, walk.dimensions))
    g = walk.scores(u)
    for _ in range(MAX_LEVELS):
        threshold = _threshold(g)
        inside = g > threshold
        if not inside.any():
            return None
        product.times(inside.mean(axis=1))
        if product.is_negligible:
            return None
        if threshold == 0.0:
            return [points[hits] for points, hits in zip(u, inside, strict=True)]
        seeds = walk.seed_positions(inside)
        u, g = walk.advance(u[seeds], g[seeds], threshold, inflation)
    return None


def _inflated(walk: Walk, inflation: float, product: Product) -> np.ndarray | None:
    """Return realizations of N(0, inflation^2) in the event (strand, n, d); None if it is not found, or negligible."""
    points = _levels(walk, inflation, product)
    if points is None:
        return None
    of_all = np.concatenate(points)
    sources = [of_strand if len(of_strand) else of_all for of_strand in points]
    seeds = np.stack([source[_resampled(np.ones(len(source)), walk.seeds, walk.rng)] for source in sources])
    return walk.advance(seeds, np.ones(seeds.shape[:2]), 0.0, inflation)[0]


def _weighted(walk: Walk, inflation: float) -> SearchResult:
    """Deflate an inflated event by weights: P_t(F) = P_s(F) E_s[w | F], w the ratio of densities of N(0, t^2), N(0, s^2)."""
    product, s = Product(), inflation
    u = _inflated(walk, inflation, product)
    if u is None:
        return product.of_nothing
    while s > 1.0:
        squares = 0.5 * (u**2).sum(axis=-1)

        def log_weights(t: float, s: float = s, squares: np.ndarray = squares) -> np.ndarray:
            return walk.dimensions * np.log(s / t) - squares * (1 / t**2 - 1 / s**2)

        t = _least(lambda t: _variance(log_weights(t)) <= MAX_VARIANCE, s)
        weights = log_weights(t)
        largest = float(weights.max())
        weights = np.exp(weights - largest)
        product.times(weights.mean(axis=1), log_scale=largest)
        if product.is_negligible:
            return product.of_nothing
        seeds = u[walk.seed_positions(weights)]
        u, _ = walk.advance(seeds, np.ones(seeds.shape[:2]), 0.0, t)
        s = t
    return SearchResult(product.estimate, list(u))


def _nested(walk: Walk, inflation: float, budget: int) -> SearchResult:
    """Deflate an inflated event by nested events, F_s = {z: g(s z) > 0} with z standard normal.

    P(F_t) / P(F_s) = P(z in F_t | F_s) / P(z in F_s | F_t) holds for any event.
    """
    product, s, pace = Product(), inflation, FIRST_PACE
    u = _inflated(walk, inflation, product)
    if u is None:
        return product.of_nothing
    z, checked_points = u / inflation, u[:, :0]  # u (strand, n, d) to be checked for membership in the previous event
    while s > 1.0:
        for _ in range(TRIES):
            t = max(1 / math.sqrt(1 / s**2 + pace), 1.0)
            scores = walk.scores(np.concatenate([checked_points, t * z], axis=1))  # one large call takes less time than two
            hits_before, hits = np.split(scores > 0, [checked_points.shape[1]], axis=1)
            product.over(hits_before)
            if product.is_negligible:
                return product.of_nothing
            checked_points = checked_points[:, :0]
            share = float(hits.mean())
            change = math.log(GOAL) / math.log(min(max(share, 1 / hits.size), 1 - 1 / hits.size))
            pace *= min(max(change, 1 / MAX_CHANGE), MAX_CHANGE)
            if share >= MIN_GOAL:
                break
        if not share:
            return product.of_nothing
        product.times(hits.mean(axis=1))
        walk.spread(budget, nested_levels(t, math.exp(product.log)))
        seeds = z[walk.seed_positions(hits)]
        z, _ = walk.advance(seeds, np.ones(seeds.shape[:2]), 0.0, stretch=t)
        checked_points = s * z[:, walk.rng.choice(z.shape[1], max(int(CHECKED_SHARE * z.shape[1]), 1), replace=False)]
        s = t
    product.over(walk.scores(checked_points) > 0)
    return SearchResult(product.estimate, list(z))


def _least(is_enough: Callable[[float], bool], s: float) -> float:
    """Return the least inflation from 1 to s that is enough, by bisection; if none is, an intermediate one."""
    if is_enough(1.0):
        return 1.0
    low, high = 1.0, s
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (low, middle) if is_enough(middle) else (middle, high)
    return high if high < s else (s + low) / 2


def _variance(log_weights: np.ndarray) -> float:
    weights = np.exp(log_weights - log_weights.max())
    return float(weights.var() / weights.mean() ** 2)


def _resampled(weights: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return the indices of `count` realizations in proportion to their weights (systematic resampling)."""
    cumulative = np.cumsum(weights)
    places = (rng.random() + np.arange(count)) / count
    return np.searchsorted(cumulative / cumulative[-1], places).clip(max=len(weights) - 1)


def _threshold(g: np.ndarray) -> float:
    """Return the threshold, at most 0, that a fifth of the scores exceed; a lower one if no score would exceed it."""
    g = g.ravel()
    threshold = float(np.sort(g)[-int(np.ceil(SHARE * len(g))) - 1])
    if threshold >= g.max() and threshold < 0:
        lower = g[g < g.max()]
        threshold = float(lower.max()) if len(lower) else threshold
    return min(threshold, 0.0)
