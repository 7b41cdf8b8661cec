"""Two searches for a rare event: by levels of its score, and by inflation of all contributors."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

SHARE = 0.2  # of each event, in the one before
FIRST_STEP, ACCEPTANCE = 0.8, 0.4  # length of steps, and the share of them that should be accepted
MIN_STEP, MAX_STEP = 0.02, 0.99
MAX_LEVELS = 60
INFLATIONS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0)
COMMON, SEEN = 0.1, 0.01  # shares of realizations in the event: inflate no further; inflate so far if it is the best
UNKNOWN_INFLATION = 3.0  # where no inflation leads to the event
MAX_WEIGHTED = 10  # contributors: with more, the weights of inflation spread too far
MAX_VARIANCE = 1.0  # of weights, of the square of their mean
GOAL = 0.25  # share of an inflated event in the one before
LOOKS, BISECTIONS = 60, 5  # realizations and steps that find the next inflation
LOOKS_BACK = 0.25  # share of realizations that are looked at in the event before
MIN_SHARE_BACK = 1e-3

Score = Callable[[np.ndarray], np.ndarray]  # u (n, d) -> (n,)
Check = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # u (n, d) -> whether it is in an event (n,), score (n,)


class Found(NamedTuple):
    """What a search has found: its estimate of the probability, and realizations in the event (n, d)."""

    probability: float
    points: np.ndarray

    @classmethod
    def nothing(cls, dimensions: int) -> "Found":
        """Return what a search says that did not find the event."""
        return cls(0.0, np.zeros((0, dimensions)))


def walks(
    check: Check, u: np.ndarray, g: np.ndarray, deviation: float, count: int, step: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return `count` realizations of N(0, deviation^2) in an event, by walks from u (n, d), their scores, and the last step."""
    walked, scores = [], []
    for _ in range(int(np.ceil(count / len(u)))):
        candidates = np.sqrt(1 - step**2) * u + step * deviation * rng.standard_normal(u.shape)
        is_accepted, candidate_scores = check(candidates)
        u, g = np.where(is_accepted[:, None], candidates, u), np.where(is_accepted, candidate_scores, g)
        step = float(np.clip(step * np.exp(is_accepted.mean() - ACCEPTANCE), MIN_STEP, MAX_STEP))
        walked.append(u)
        scores.append(g)
    return np.concatenate(walked)[:count], np.concatenate(scores)[:count], step


def by_levels(score: Score, dimensions: int, count: int, rng: np.random.Generator, inflation: float = 1.0) -> Found:
    """Search by levels of the score, with `count` realizations of N(0, inflation^2) at each level."""
    u = inflation * rng.standard_normal((count, dimensions))
    g, log_probability, step = score(u), 0.0, FIRST_STEP
    for _ in range(MAX_LEVELS):
        threshold = _threshold(g)
        inside = g > threshold
        if not inside.any():
            break
        log_probability += np.log(inside.mean())
        u, g = u[inside], g[inside]
        if threshold == 0.0:
            return Found(float(np.exp(log_probability)), u)
        u, g, step = walks(_above(score, threshold), u, g, inflation, count, step, rng)
    return Found.nothing(dimensions)


def first_inflation(score: Score, dimensions: int, count: int, rng: np.random.Generator) -> float:
    """Return the least inflation at which the event is common, or at which it is most common, from `count` looks at each."""
    shares = [float((score(s * rng.standard_normal((count, dimensions))) > 0).mean()) for s in INFLATIONS]
    common = [s for s, share in zip(INFLATIONS, shares, strict=True) if share >= COMMON]
    if common:
        return common[0]
    return INFLATIONS[int(np.argmax(shares))] if max(shares) > SEEN else UNKNOWN_INFLATION


def by_inflation(score: Score, dimensions: int, count: int, rng: np.random.Generator, inflation: float) -> Found:
    """Search from an inflation back to none, with `count` realizations at each level."""
    search = _weighted if dimensions <= MAX_WEIGHTED else _nested
    return search(score, dimensions, count, rng, inflation)


def _weighted(score: Score, dimensions: int, count: int, rng: np.random.Generator, inflation: float) -> Found:
    """Bring an inflated event back by weights: P_t(F) = P_s(F) E_s[w | F], w the ratio of densities of N(0, t^2), N(0, s^2)."""
    probability, u = by_levels(score, dimensions, count, rng, inflation)
    if not len(u):
        return Found(probability, u)
    log_probability, step, s = np.log(probability), FIRST_STEP, inflation
    while s > 1.0:
        squares = 0.5 * (u**2).sum(axis=1)

        def log_weights(t: float, s: float = s, squares: np.ndarray = squares) -> np.ndarray:
            return dimensions * np.log(s / t) - squares * (1 / t**2 - 1 / s**2)

        t = _least(lambda t: _variance(log_weights(t)) <= MAX_VARIANCE, s)
        weights = log_weights(t)
        largest = weights.max()
        weights = np.exp(weights - largest)
        log_probability += np.log(weights.mean()) + largest
        if t == 1.0:
            return Found(float(np.exp(log_probability)), u[_resampled(weights, count, rng)])
        seeds = u[_resampled(weights, max(count // 5, 10), rng)]
        u, _, step = walks(_above(score, 0.0), seeds, np.ones(len(seeds)), t, count, step, rng)
        s = t
    return Found(float(np.exp(log_probability)), u)


def _nested(score: Score, dimensions: int, count: int, rng: np.random.Generator, inflation: float) -> Found:
    """Bring an inflated event back by nested ones, F_s = {z: g(s z) > 0} with z standard normal.

    P(F_t) / P(F_s) = P(z in F_t | F_s) / P(z in F_s | F_t) holds for any event.
    """
    probability, u = by_levels(score, dimensions, count, rng, inflation)
    z, s, step = u / inflation, inflation, FIRST_STEP
    log_probability = np.log(probability) if len(z) else -np.inf
    for _ in range(MAX_LEVELS):
        if s == 1.0 or not len(z):
            break
        sample = z[rng.choice(len(z), min(LOOKS, len(z)), replace=False)]
        t = _least(lambda t: (score(t * sample) > 0).mean() >= GOAL, s, BISECTIONS)  # noqa: B023  is called at once
        hits = score(t * z) > 0
        z = z[hits]
        if not len(z):
            break
        log_probability += np.log(hits.mean())
        z, _, step = walks(lambda z: _above(score, 0.0)(t * z), z, np.ones(len(z)), 1.0, count, step, rng)  # noqa: B023
        looks = z[rng.choice(len(z), max(int(LOOKS_BACK * len(z)), 1), replace=False)]
        log_probability -= np.log(max(float((score(s * looks) > 0).mean()), MIN_SHARE_BACK))
        s = t
    return Found(float(np.exp(log_probability)), z) if s == 1.0 and len(z) else Found.nothing(dimensions)


def _least(is_enough: Callable[[float], bool], s: float, bisections: int = 30) -> float:
    """Return the least inflation from 1 to s that is enough, by bisection; if none is, one in between."""
    if is_enough(1.0):
        return 1.0
    low, high = 1.0, s
    for _ in range(bisections):
        middle = (low + high) / 2
        low, high = (low, middle) if is_enough(middle) else (middle, high)
    return high if high < s else (s + low) / 2


def _variance(log_weights: np.ndarray) -> float:
    weights = np.exp(log_weights - log_weights.max())
    return float(weights.var() / weights.mean() ** 2)


def _resampled(weights: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return `count` numbers of realizations, each as often as its weight says (systematic resampling)."""
    cumulative = np.cumsum(weights)
    places = (rng.random() + np.arange(count)) / count
    return np.searchsorted(cumulative / cumulative[-1], places).clip(max=len(weights) - 1)


def _above(score: Score, threshold: float) -> Check:
    def check(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        g = score(u)
        return g > threshold, g

    return check


def _threshold(g: np.ndarray) -> float:
    """Return the threshold, at most 0, that a fifth of the scores exceed; a lower one if otherwise none would exceed it."""
    threshold = float(np.sort(g)[-int(np.ceil(SHARE * len(g))) - 1])
    if threshold >= g.max() and threshold < 0:
        lower = g[g < g.max()]
        threshold = float(lower.max()) if len(lower) else threshold
    return min(threshold, 0.0)
