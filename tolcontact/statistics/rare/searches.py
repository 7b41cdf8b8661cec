"""Two searches for a rare event: by levels of its score, and by inflation of all contributors.

Searches are generators that ask for scores, so that independent ones can be answered together: few realizations at a time cost
almost as much as many.
"""

from collections.abc import Callable, Generator, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

T = TypeVar("T")

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
Scores = Generator[np.ndarray, np.ndarray, T]  # yields realizations u (n, d), is sent their scores (n,), and returns something
Judge = Callable[[np.ndarray], np.ndarray]  # scores (n,) -> whether realizations are in an event (n,)


class Found(NamedTuple):
    """What a search has found: its estimate of the probability, and realizations in the event (n, d)."""

    probability: float
    points: np.ndarray

    @classmethod
    def nothing(cls, dimensions: int) -> "Found":
        """Return what a search says that did not find the event."""
        return cls(0.0, np.zeros((0, dimensions)))


def answered(searches: Sequence[Scores[T]], score: Score) -> list[T]:
    """Return what searches find, whose questions are answered together."""
    found: dict[int, T] = {}
    questions: dict[int, np.ndarray] = {}
    replies: dict[int, np.ndarray | None] = dict.fromkeys(range(len(searches)))
    while replies:
        for number, reply in replies.items():
            try:
                questions[number] = searches[number].send(reply)  # type: ignore[arg-type]  # None at first
            except StopIteration as end:
                found[number] = end.value
        if not questions:
            break
        scores = np.split(score(np.concatenate([*questions.values()])), np.cumsum([len(u) for u in questions.values()])[:-1])
        replies, questions = dict(zip(questions, scores, strict=True)), {}
    return [found[number] for number in range(len(searches))]


def walks(
    inside: Judge, u: np.ndarray, g: np.ndarray, deviation: float, count: int, step: float, rng: np.random.Generator,
    stretch: float = 1.0,
) -> Scores[tuple[np.ndarray, np.ndarray, float]]:  # fmt: skip
    """Return `count` realizations of N(0, deviation^2) in an event, by walks from u (n, d), their scores, and the last step.

    Scores are those of realizations times `stretch`.
    """
    walked, scores = [], []
    for _ in range(int(np.ceil(count / len(u)))):
        candidates = np.sqrt(1 - step**2) * u + step * deviation * rng.standard_normal(u.shape)
        candidate_scores = yield stretch * candidates
        is_accepted = inside(candidate_scores)
        u, g = np.where(is_accepted[:, None], candidates, u), np.where(is_accepted, candidate_scores, g)
        step = float(np.clip(step * np.exp(is_accepted.mean() - ACCEPTANCE), MIN_STEP, MAX_STEP))
        walked.append(u)
        scores.append(g)
    return np.concatenate(walked)[:count], np.concatenate(scores)[:count], step


def by_levels(dimensions: int, count: int, rng: np.random.Generator, inflation: float = 1.0) -> Scores[Found]:
    """Search by levels of the score, with `count` realizations of N(0, inflation^2) at each level."""
    u = inflation * rng.standard_normal((count, dimensions))
    g = yield u
    log_probability, step = 0.0, FIRST_STEP
    for _ in range(MAX_LEVELS):
        threshold = _threshold(g)
        inside = g > threshold
        if not inside.any():
            break
        log_probability += np.log(inside.mean())
        u, g = u[inside], g[inside]
        if threshold == 0.0:
            return Found(float(np.exp(log_probability)), u)
        u, g, step = yield from walks(_above(threshold), u, g, inflation, count, step, rng)
    return Found.nothing(dimensions)


def first_inflation(dimensions: int, count: int, rng: np.random.Generator) -> Scores[float]:
    """Return the least inflation at which the event is common, or at which it is most common, from `count` looks at each."""
    scores = yield np.concatenate([s * rng.standard_normal((count, dimensions)) for s in INFLATIONS])
    shares = [float((g > 0).mean()) for g in np.split(scores, len(INFLATIONS))]
    common = [s for s, share in zip(INFLATIONS, shares, strict=True) if share >= COMMON]
    if common:
        return common[0]
    return INFLATIONS[int(np.argmax(shares))] if max(shares) > SEEN else UNKNOWN_INFLATION


def by_inflation(dimensions: int, count: int, rng: np.random.Generator, inflation: float) -> Scores[Found]:
    """Search from an inflation back to none, with `count` realizations at each level."""
    search = _weighted if dimensions <= MAX_WEIGHTED else _nested
    return search(dimensions, count, rng, inflation)


def _weighted(dimensions: int, count: int, rng: np.random.Generator, inflation: float) -> Scores[Found]:
    """Bring an inflated event back by weights: P_t(F) = P_s(F) E_s[w | F], w the ratio of densities of N(0, t^2), N(0, s^2)."""
    probability, u = yield from by_levels(dimensions, count, rng, inflation)
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
        u, _, step = yield from walks(_above(0.0), seeds, np.ones(len(seeds)), t, count, step, rng)
        s = t
    return Found(float(np.exp(log_probability)), u)


def _nested(dimensions: int, count: int, rng: np.random.Generator, inflation: float) -> Scores[Found]:
    """Bring an inflated event back by nested ones, F_s = {z: g(s z) > 0} with z standard normal.

    P(F_t) / P(F_s) = P(z in F_t | F_s) / P(z in F_s | F_t) holds for any event.
    """
    probability, u = yield from by_levels(dimensions, count, rng, inflation)
    z, s, step = u / inflation, inflation, FIRST_STEP
    log_probability = np.log(probability) if len(z) else -np.inf
    for _ in range(MAX_LEVELS):
        if s == 1.0 or not len(z):
            break
        sample = z[rng.choice(len(z), min(LOOKS, len(z)), replace=False)]
        t = yield from _least_common(sample, s)
        hits = (yield t * z) > 0
        z = z[hits]
        if not len(z):
            break
        log_probability += np.log(hits.mean())
        z, _, step = yield from walks(_above(0.0), z, np.ones(len(z)), 1.0, count, step, rng, stretch=t)
        looks = z[rng.choice(len(z), max(int(LOOKS_BACK * len(z)), 1), replace=False)]
        share_back = float(((yield s * looks) > 0).mean())
        log_probability -= np.log(max(share_back, MIN_SHARE_BACK))
        s = t
    return Found(float(np.exp(log_probability)), z) if s == 1.0 and len(z) else Found.nothing(dimensions)


def _least(is_enough: Callable[[float], bool], s: float) -> float:
    """Return the least inflation from 1 to s that is enough, by bisection; if none is, one in between."""
    bisection = _bisection(s, 30)
    t = next(bisection)
    while True:
        try:
            t = bisection.send(is_enough(t))
        except StopIteration as end:
            return float(end.value)


def _least_common(z: np.ndarray, s: float) -> Scores[float]:
    """Return the least inflation t from 1 to s of realizations z (n, d) of which enough, t z, are in the event."""
    bisection = _bisection(s, BISECTIONS)
    t = next(bisection)
    while True:
        g = yield t * z
        try:
            t = bisection.send(bool((g > 0).mean() >= GOAL))
        except StopIteration as end:
            return float(end.value)


def _bisection(s: float, bisections: int) -> Generator[float, bool, float]:
    """Yield inflations from 1 to s, and return the least that is said to be enough; if none is, one in between."""
    if (yield 1.0):
        return 1.0
    low, high = 1.0, s
    for _ in range(bisections):
        middle = (low + high) / 2
        low, high = (low, middle) if (yield middle) else (middle, high)
    return high if high < s else (s + low) / 2


def _variance(log_weights: np.ndarray) -> float:
    weights = np.exp(log_weights - log_weights.max())
    return float(weights.var() / weights.mean() ** 2)


def _resampled(weights: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return `count` numbers of realizations, each as often as its weight says (systematic resampling)."""
    cumulative = np.cumsum(weights)
    places = (rng.random() + np.arange(count)) / count
    return np.searchsorted(cumulative / cumulative[-1], places).clip(max=len(weights) - 1)


def _above(threshold: float) -> Judge:
    def inside(g: np.ndarray) -> np.ndarray:
        return g > threshold

    return inside


def _threshold(g: np.ndarray) -> float:
    """Return the threshold, at most 0, that a fifth of the scores exceed; a lower one if otherwise none would exceed it."""
    threshold = float(np.sort(g)[-int(np.ceil(SHARE * len(g))) - 1])
    if threshold >= g.max() and threshold < 0:
        lower = g[g < g.max()]
        threshold = float(lower.max()) if len(lower) else threshold
    return min(threshold, 0.0)
