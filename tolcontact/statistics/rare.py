"""Probabilities of events that are too rare to be counted.

A score g(u) of independent standard normal contributors u states whether a realization is in an event, g > 0, and for some
events also how near it is otherwise. Two searches look for the regions of the event:

by levels of the score (subset simulation; Au, Beck, 2001). The event is the last of nested events, g > c_1, g > c_2, ...,
g > 0. Each is a fifth of the previous one, and

    p = P(g > c_1) P(g > c_2 | g > c_1) ... P(g > 0 | g > c_last)

by inflation. All contributors are inflated until the event is common, u ~ N(0, s^2), and brought back to s = 1. With few
contributors realizations are weighted by the ratio of the densities, and resampled; with many the inflations are nested.

Each search consists of eight strands that share levels or inflations. Their differences determine the accuracy of the product.

The searches have different weaknesses: levels favour the region with the largest scores, and inflation favours distant regions.
Realizations within the event walk by u' = sqrt(1 - b^2) u + b v, v standard normal, accepted if u' is in the event (Papaioannou
and others, 2015). The results of both searches are the centres of a mixture of standard normals, which gives the probability by
importance sampling. This estimate is unbiased for any centres, but a region that neither search found is missing from it. It is
therefore used only if its weights are spread over many realizations, with no dominant one, and if neither search gives a
significantly larger value. Where a region was reached by one or two strands only, there may be others, and the interval is
widened (Good, 1953). Otherwise the result is the mean of the searches; where they disagree, the interval covers both, and
`disagreement` states it.

A search ends below 1e-9. The probability of the event is then reported as 0. Its upper bound is the probability of the last
level, which contains the event, or of the inflated event, on the assumption that less inflation makes an event no more
probable.

With more than ten contributors, the means of contributors without influence are noise in a centre, which spreads the weights:
entries of a centre below five standard errors are set to 0.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import cluster, special

from tolcontact.statistics import intervals
from tolcontact.statistics.intervals import Estimate
from tolcontact.statistics.rare_searches import (
    BEFORE_NESTED,
    MAX_WEIGHTED,
    MIN_LEVEL,
    STRANDS,
    Score,
    SearchResult,
    Walk,
    by_inflation,
    by_levels,
    first_inflation,
    nested_levels,
)

CENTRE_COUNTS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)  # trial numbers of centres
MIN_PER_CENTRE = 4
MAX_FITTED = 1500  # realizations
MIN_GAIN = 0.01  # of the mean log-likelihood: smallest gain that justifies another centre
ITERATIONS = 10
FEW_DIMENSIONS, NOISE = 10, 5.0  # with more dimensions, this many standard errors of a centre are noise
PILOT, MIN_COUNTED = 0.05, 50  # share of all realizations; number of hits among them above which the event is counted
FIRST_SHARE = 0.25  # of all realizations
SUFFICIENT, MIN_SUFFICIENT = 1.5, 30_000  # upper over lower bound that suffices, with this many realizations
SEARCHABLE, MIN_PILOT, MIN_FEW = 10_000, 500, 3  # with fewer realizations, counting beats searches even with few hits
SEARCHES = (0.25, 0.3)  # of all realizations: by levels, by inflation
SCOUTING = 0.04  # of a search, for each trial inflation
TRIAL, MIN_TRIAL = 0.01, 5  # of a search, at each level, to count its levels; and the minimum for each strand
MIN_TRIALS = 50  # for each trial inflation
MIN_GROUP = 8  # realizations of a search needed to fit centres
AROUND_ZERO = 0.1  # share of the mixture that is drawn without a shift
REFITS = 2  # to the results of the searches
ROUNDS, ROUND = 2, 0.15  # of importance sampling before the last one, and their shares, for finding missing centres
MIN_REFIT, REFIT = 40, 500  # hits needed to refit centres, and the number drawn from them
MAX_UNSEEN = 0.9  # of an event
MIN_EFFECTIVE, MAX_WEIGHT = 200, 0.02  # effective hits that importance sampling needs, and the largest share of a single one
SIGNIFICANT = 1.7  # times both half widths: a larger search result shows what importance sampling missed (0.25 % by chance)


class Mixture(NamedTuple):
    """Standard normals around `centres` (k, d), with `shares` (k,)."""

    centres: np.ndarray
    shares: np.ndarray

    def log_ratio(self, u: np.ndarray) -> np.ndarray:
        """Return the logarithm of the mixture density over the standard normal density, at u (n, d)."""
        exponents = u @ self.centres.T - 0.5 * (self.centres**2).sum(axis=1)
        return np.asarray(special.logsumexp(exponents + np.log(self.shares), axis=1))

    def nearest(self, u: np.ndarray) -> np.ndarray:
        """Return the index of the centre with the largest likelihood of each realization u (n, d)."""
        return np.asarray(np.argmax(u @ self.centres.T - 0.5 * (self.centres**2).sum(axis=1), axis=1))

    def flattened(self) -> "Mixture":
        """Return the mixture with shares half as far from equal shares, since small clusters are equally important."""
        return self._replace(shares=0.5 * self.shares + 0.5 / len(self.shares))

    def weights(self, score: Score, count: int, dimensions: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return realizations of the mixture (count, d), and their weights (count,), which are 0 outside the event."""
        numbers = rng.choice(len(self.shares), size=count, p=self.shares)
        u, w = rng.standard_normal((count, dimensions)) + self.centres[numbers], np.zeros(count)
        hits = np.flatnonzero(score(u) > 0)
        w[hits] = np.exp(-self.log_ratio(u[hits]))
        return u, w


def joined(mixtures: Sequence[Mixture], shares: Sequence[float]) -> Mixture:
    """Return a mixture of mixtures."""
    return Mixture(
        np.concatenate([mixture.centres for mixture in mixtures]),
        np.concatenate([share * mixture.shares for mixture, share in zip(mixtures, shares, strict=True)]),
    )


def fitted(groups: Sequence[np.ndarray], rng: np.random.Generator) -> Mixture:
    """Return a mixture fitted to independent groups (n, d).

    The number of centres is chosen by cross-validation: a fit to one half of the groups is evaluated on the other half.
    """
    limit = MAX_FITTED // len(groups)
    groups = [group[rng.choice(len(group), min(len(group), limit), replace=False)] for group in groups]
    number = 4
    if len(groups) > 1:
        training, validation = np.concatenate(groups[::2]), np.concatenate(groups[1::2])
        best = -np.inf
        for candidate in CENTRE_COUNTS:
            if candidate > max(len(training) // MIN_PER_CENTRE, 1):
                break
            likelihood = float(_clustered(training, candidate, rng).log_ratio(validation).mean())
            if likelihood > best + MIN_GAIN:
                best, number = likelihood, candidate
    return _clustered(np.concatenate(groups), number, rng)


def _clustered(points: np.ndarray, number: int, rng: np.random.Generator) -> Mixture:
    """Return the clusters of points (n, d) by k-means, with k-means++ starts, and their shares."""
    distinct = len(np.unique(points, axis=0))
    centres, labels = cluster.vq.kmeans2(points, min(number, distinct), iter=ITERATIONS, minit="++", missing="warn", rng=rng)
    shares = np.bincount(labels, minlength=len(centres)) / len(points)
    if points.shape[1] > FEW_DIMENSIONS:
        # Means of contributors without influence are noise; in many dimensions it would spread the weights.
        sizes = np.array([len(np.unique(points[labels == label], axis=0)) for label in range(len(centres))])
        centres = np.where(np.abs(centres) * np.sqrt(sizes)[:, None] < NOISE, 0.0, centres)
    return Mixture(centres[shares > 0], shares[shares > 0])


class Tail(NamedTuple):
    """The probability of an event, and the ratio of the searches' results where they disagree: 1 if they agree."""

    probability: Estimate
    disagreement: float


def sufficient_tail(score: Score, dimensions: int, *, samples: int, rng: np.random.Generator, leads: bool = True) -> Tail:
    """Return the `tail_probability` from at most about `samples` realizations.

    A quarter of them suffices if the searches agree, and the upper bound is at most 1.5 times the lower one. This needs many
    realizations, since few may miss regions of the event. Otherwise the result comes from the remaining realizations alone. A
    small probability does not suffice: to stop because a bound is small selects the answers that are too small.
    """
    look = int(FIRST_SHARE * samples)
    if look >= MIN_SUFFICIENT:
        tail = tail_probability(score, dimensions, samples=look, rng=rng, leads=leads)
        if tail.disagreement == 1.0 and 0.0 < tail.probability.upper <= SUFFICIENT * tail.probability.lower:
            return tail
        samples -= look
    return tail_probability(score, dimensions, samples=samples, rng=rng, leads=leads)


def tail_probability(score: Score, dimensions: int, *, samples: int, rng: np.random.Generator, leads: bool = True) -> Tail:
    """Return the probability that a score is above 0, with its 95 % interval, from about `samples` realizations.

    leads   whether scores outside the event state how near it is; otherwise only the search by inflation is used
    """
    is_small = samples < SEARCHABLE
    pilot = score(rng.standard_normal((max(int(PILOT * samples), MIN_PILOT), dimensions))) > 0
    if pilot.sum() >= (MIN_FEW if is_small else MIN_COUNTED):
        return Tail(intervals.proportion(score(rng.standard_normal((samples - len(pilot), dimensions))) > 0), 1.0)
    budgets = [int(share * samples) for share in SEARCHES]
    searches = [_searched(score, dimensions, sum(budgets) if not leads else budgets[1], rng, inflates=True)]
    if leads:
        searches.insert(0, _searched(score, dimensions, budgets[0], rng, inflates=False))
    answers = [search.probability for search in searches]
    budget_drawn = int((1 - PILOT - sum(SEARCHES)) * samples)
    groups = [halves for search in searches if (halves := _halves(search.points))]
    if not groups:
        if all(estimate.upper == 1.0 for estimate in answers):
            return Tail(intervals.proportion(score(rng.standard_normal((budget_drawn, dimensions))) > 0), 1.0)
        return _combined(answers)
    u, weights = _importance(score, dimensions, groups, budget_drawn, rng)
    if not _has_spread_weights(weights):
        return _combined(answers)
    mean = float(weights.mean())
    reach = math.exp(intervals.student(np.inf) * float(weights.std()) / mean / math.sqrt(len(weights)))
    hits = np.flatnonzero(weights)
    hits = rng.choice(hits, min(2 * REFIT, len(hits)), p=weights[hits] / weights.sum())
    unseen = unseen_share([strand for search in searches for strand in search.points], u[hits], rng)
    estimate = Estimate(mean, mean / reach, min(mean * reach / (1 - unseen), 1.0))
    for alternative in answers:
        if alternative.value > 0 and math.log(alternative.value / mean) > SIGNIFICANT * math.hypot(
            _log_width(alternative), _log_width(estimate)
        ):
            return Tail(estimate._replace(upper=max(estimate.upper, alternative.upper)), alternative.value / mean)
    return Tail(estimate, 1.0)


def either(tails: Sequence[Tail]) -> Tail:
    """Return the probability that one of several mutually exclusive events occurs, from independent estimates.

    Distances of the bounds from the estimates add up like errors (Zou and Donner, 2008).
    """
    estimates = np.array([tail.probability for tail in tails])
    total = float(estimates[:, 0].sum())
    reach_below, reach_above = (math.sqrt(float(((estimates[:, k] - estimates[:, 0]) ** 2).sum())) for k in (1, 2))
    bounds = max(total - reach_below, 0.0), min(total + reach_above, 1.0)
    return Tail(Estimate(total, *bounds), max(tail.disagreement for tail in tails))


def _searched(score: Score, dimensions: int, budget: int, rng: np.random.Generator, *, inflates: bool) -> SearchResult:
    """Return the result of a search with about `budget` realizations."""
    used, inflation = 0, 1.0

    def counting(u: np.ndarray) -> np.ndarray:
        nonlocal used
        used += len(u)
        return score(u)

    def search(count: int) -> SearchResult:
        walk = Walk(counting, dimensions, count, rng)
        return by_inflation(walk, inflation, budget - used) if inflates else by_levels(walk)

    if inflates:
        inflation, share = first_inflation(counting, dimensions, max(int(SCOUTING * budget), MIN_TRIALS), rng)
    if inflates and dimensions > MAX_WEIGHTED:
        levels = BEFORE_NESTED + nested_levels(inflation, share)
    else:
        trial, used_before = max(int(TRIAL * budget) // STRANDS, MIN_TRIAL), used
        search(trial)
        levels = max((used - used_before) / STRANDS / trial, 1.0)
    return search(max(int((budget - used) / STRANDS / levels), MIN_LEVEL))


def _halves(points: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the realizations of the even and of the odd strands, (n, d), without halves that are too small."""
    halves = [np.concatenate(strands) for k in range(2) if (strands := points[k::2])]
    return [half for half in halves if len(half) >= MIN_GROUP]


def _importance(
    score: Score, dimensions: int, groups: Sequence[Sequence[np.ndarray]], count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return realizations drawn around the results of each search, groups of (n, d), and their weights: 0 outside the event."""
    around_zero = Mixture(np.zeros((1, dimensions)), np.ones(1))
    shares = [(1 - AROUND_ZERO) / len(groups)] * len(groups)
    mixtures = [fitted(group, rng).flattened() for group in groups]
    mixture, batch = joined([*mixtures, around_zero], [*shares, AROUND_ZERO]), int(ROUND * count)
    points = np.concatenate([points for group in groups for points in group])
    for _ in range(REFITS):
        mixture = _completed(mixture, points, np.exp(-mixture.log_ratio(points)), rng)
    for _ in range(ROUNDS):
        u, w = mixture.weights(score, batch, dimensions, rng)
        hits = np.flatnonzero(w)
        if len(hits) > MIN_REFIT:
            mixture = _completed(mixture, u[hits], w[hits], rng)
    return mixture.weights(score, count - ROUNDS * batch, dimensions, rng)


def _completed(mixture: Mixture, u: np.ndarray, w: np.ndarray, rng: np.random.Generator) -> Mixture:
    """Return the mixture with more centres where realizations (n, d) in the event have large weights: some are missing there.

    w   (n,): weights, up to a common factor
    """
    groups = [u[rng.choice(len(u), REFIT, p=w / w.sum())] for _ in range(2)]
    return joined([mixture, fitted(groups, rng).flattened()], [0.5, 0.5])


def unseen_share(strands: Sequence[np.ndarray], hits: np.ndarray, rng: np.random.Generator) -> float:
    """Return an upper bound of the share of an event that no strand reached.

    The regions of the event are clusters of realizations drawn in it, `hits` (n, d). Regions that only one strand reached are
    about as probable as regions that none reached (Good, 1953). The standard error also counts regions that two reached, and
    is not 0 if no region was reached by one alone.
    """
    ways = fitted([hits[::2], hits[1::2]], rng)
    strands = [points for points in strands if len(points)]
    shares = np.array([np.bincount(ways.nearest(points), minlength=len(ways.shares)) / len(points) for points in strands])
    visits = (shares > 0).sum(axis=0)
    singles, doubles = (float(shares[:, visits == number].sum()) for number in (1, 2))
    return min((singles + intervals.student(np.inf) * math.sqrt(singles + doubles)) / len(strands), MAX_UNSEEN)


def _has_spread_weights(weights: np.ndarray) -> bool:
    """Return whether the weights are spread over many realizations, with no dominant one."""
    return intervals.effective_count(weights) >= MIN_EFFECTIVE and bool(weights.max() <= MAX_WEIGHT * weights.sum())


def _combined(answers: Sequence[Estimate]) -> Tail:
    """Return the mean of the searches' results if they agree, else the larger with an interval that covers both.

    A search that misses a region of the event gives too small a value, so the upper bounds of both bound the mean.
    """
    best = max(answers, key=lambda estimate: estimate.value)
    if len(answers) == 1:
        return Tail(best, 1.0)
    answer, alternative = answers
    if best.value == 0.0:  # negligible for all searches that found their way
        return Tail(max((estimate for estimate in answers if estimate.upper < 1.0), key=lambda estimate: estimate.upper), 1.0)
    if min(answer.value, alternative.value) == 0.0 and best.value <= min(answer.upper, alternative.upper) < 1.0:
        return Tail(best, 1.0)  # the other search ended where the event was negligible
    if not (answer.value > 0 and alternative.value > 0):
        return Tail(best._replace(lower=0.0), math.inf)
    widths = _log_width(answer), _log_width(alternative)
    if abs(math.log(answer.value / alternative.value)) > math.hypot(*widths):
        bounds = min(answer.lower, alternative.lower), max(answer.upper, alternative.upper)
        return Tail(Estimate(best.value, *bounds), max(answer.value / alternative.value, alternative.value / answer.value))
    mean = (answer.value + alternative.value) / 2
    reach = math.exp(math.hypot(answer.value * widths[0], alternative.value * widths[1]) / 2 / mean)
    return Tail(Estimate(mean, mean / reach, max(answer.upper, alternative.upper)), 1.0)


def _log_width(estimate: Estimate) -> float:
    """Return the half width of an interval on the log scale."""
    return math.log(estimate.upper / estimate.value)
