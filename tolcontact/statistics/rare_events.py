"""Probabilities of events too rare to be counted: subset simulation (Au, Beck, 2001).

A score g(u) of independent standard normal contributors u says how near a realization is to an event, which is g > 0. The event
is the last of nested ones, g > c_1, g > c_2, ..., g > 0, of which each is a fifth of the one before:

    p = P(g > c_1) P(g > c_2 | g > c_1) ... P(g > 0 | g > c_last)

The first is counted among independent realizations, each other one among those that random walks within the event before reach:
u' = sqrt(1 - b^2) u + b v, v standard normal, which is taken if u' is in that event (Papaioannou and others, 2015). The number
of contributors does not matter, nor whether the event is connected or smooth. Walks are not independent of each other, so the
whole is repeated: the interval is Student's t over replicates.
"""

from collections.abc import Callable

import numpy as np

from tolcontact.statistics import intervals
from tolcontact.statistics.intervals import Estimate

REPLICATES = 16
SHARE = 0.2  # of each event, in the one before
PILOT, FORESEEN = 0.1, 5  # of all realizations: to see how many levels there will be, and how many are expected
MIN_LEVEL_SAMPLES = 50  # realizations at a level
ACCEPTANCE = 0.4  # share of steps that should be accepted
FIRST_STEP = 0.8
MAX_LEVELS = 20  # down to 1e-14

Score = Callable[[np.ndarray], np.ndarray]  # u (n, d) -> (n,)


def tail_probability(score: Score, dimensions: int, *, samples: int, rng: np.random.Generator) -> Estimate:
    """Return the probability that a score is above 0, with its 95 % interval, from about `samples` realizations.

    Where scores do not lead to the event, it is counted. The interval of an event that never occurred is that of no hit.
    """
    probability, levels = _descent(score, dimensions, max(int(PILOT * samples / FORESEEN), MIN_LEVEL_SAMPLES), rng)
    remaining = int((1 - PILOT) * samples)
    if levels == 0 or probability == 0:
        return intervals.proportion(score(rng.standard_normal((remaining, dimensions))) > 0)
    count = max(remaining // REPLICATES // (1 + levels), MIN_LEVEL_SAMPLES)
    estimates = np.array([_descent(score, dimensions, count, rng)[0] for _ in range(REPLICATES)])
    return mean_probability(estimates) if estimates.any() else intervals.proportion_of(0, REPLICATES * count)


def mean_probability(estimates: np.ndarray) -> Estimate:
    """Return the mean of independent estimates of a probability, which are not all zero, with its 95 % interval.

    Estimates are skewed to the right: the interval of their mean is that of its logarithm.
    """
    mean, error = estimates.mean(), estimates.std(ddof=1) / np.sqrt(len(estimates))
    reach = np.exp(intervals.student(len(estimates) - 1) * error / mean)
    return Estimate(float(mean), float(mean / reach), float(min(mean * reach, 1.0)))


def _descent(score: Score, dimensions: int, count: int, rng: np.random.Generator) -> tuple[float, int]:
    """Return an estimate of the probability from `count` realizations at each level, and the number of conditional levels."""
    u = rng.standard_normal((count, dimensions))
    g, probability, step = score(u), 1.0, FIRST_STEP
    for level in range(MAX_LEVELS):
        threshold = _threshold(g)
        inside = g > threshold
        probability *= float(inside.mean())
        if threshold == 0.0 or not inside.any():
            return probability, level
        u, g, step = _walks(score, u[inside], g[inside], threshold, count, step, rng)
    return 0.0, MAX_LEVELS


def _threshold(g: np.ndarray) -> float:
    """Return the threshold, at most 0, that a fifth of the scores exceed; a lower one if otherwise none would exceed it."""
    threshold = float(np.sort(g)[-int(np.ceil(SHARE * len(g))) - 1])
    if threshold >= g.max() and threshold < 0:
        lower = g[g < g.max()]
        threshold = float(lower.max()) if len(lower) else threshold
    return min(threshold, 0.0)


def _walks(
    score: Score, u: np.ndarray, g: np.ndarray, threshold: float, count: int, step: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return `count` realizations above a threshold, by walks from the given ones, their scores, and the last step length."""
    walked, scores = [], []
    for _ in range(int(np.ceil(count / len(u)))):
        candidates = np.sqrt(1 - step**2) * u + step * rng.standard_normal(u.shape)
        candidate_scores = score(candidates)
        is_accepted = candidate_scores > threshold
        u, g = np.where(is_accepted[:, None], candidates, u), np.where(is_accepted, candidate_scores, g)
        step = float(np.clip(step * np.exp(is_accepted.mean() - ACCEPTANCE), 0.01, 0.99))
        walked.append(u)
        scores.append(g)
    return np.concatenate(walked)[:count], np.concatenate(scores)[:count], step
