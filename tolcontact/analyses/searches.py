"""Searches for extreme values of measures: their thoroughness, their goals, and the points where they are."""

import itertools
import math
from dataclasses import dataclass, fields

import numpy as np

from tolcontact import vocabulary as terms

SHRINKAGE = 0.25  # of a step


@dataclass(frozen=True)
class Effort:
    """The thoroughness of searches.

    best, random  number of searches for each extreme value, from the best combinations and from random ones
    finest_step   the step at which a search ends, in shares of the ranges; the best ones continue to a fifth of that
    """

    best: int
    random: int
    finest_step: float = 0.05

    @classmethod
    def of(cls, samples: int) -> "Effort":
        """Return the effort for a number of random combinations: 4 and 8 searches for 1024."""
        return cls(best=max(samples // 256, 1), random=max(samples // 128, 2))

    @property
    def searches(self) -> int:
        """The number of searches for each extreme value."""
        return self.best + self.random

    @property
    def levels(self) -> int:
        """The number of step lengths, from 1 to the finest one."""
        return math.ceil(math.log(self.finest_step) / math.log(SHRINKAGE))


@dataclass(eq=False)
class Searches:
    """Searches with their goals and their present points.

    sense, state, measure  (n,): +1 for the largest, -1 for the least value, of a measure in a state
    point                  (n, contributor)
    value                  (n,): sense times the measure
    step                   (n,): in shares of the ranges
    """

    sense: np.ndarray
    state: np.ndarray
    measure: np.ndarray
    point: np.ndarray
    value: np.ndarray
    step: np.ndarray

    @classmethod
    def begin(cls, starts: np.ndarray, measured: np.ndarray, effort: Effort, rng: np.random.Generator) -> "Searches":
        """Return searches for each measure, state and sense, from points `starts` (n, contributor).

        They start at the best points according to `measured` (n, state, measure), and at random ones among the others.
        """
        searches, ones = [], np.ones(effort.searches, dtype=int)
        for measure, state, sense in itertools.product(range(measured.shape[2]), range(measured.shape[1]), terms.SENSES):
            values = np.nan_to_num(sense * measured[:, state, measure], nan=-np.inf)
            order = np.argsort(-values, kind="stable")
            worse = order[effort.best : max(int(np.isfinite(values).sum()), effort.best + 1)]
            rows = np.concatenate([order[: effort.best], rng.choice(worse, effort.random)])
            searches.append(cls(sense * ones, state * ones, measure * ones, starts[rows], values[rows], 1.0 * ones))
        return cls(*(np.concatenate([getattr(search, field.name) for search in searches]) for field in fields(cls)))

    def take(self, rows: np.ndarray) -> "Searches":
        """Return copies of the searches in `rows`."""
        return Searches(*(getattr(self, field.name)[rows] for field in fields(self)))

    def best_of(self, count: int) -> "Searches":
        """Return copies of the best of each `count` consecutive searches."""
        return self.take(self.value.reshape(-1, count).argmax(axis=1) + np.arange(0, len(self.value), count))

    def put(self, rows: np.ndarray, searches: "Searches") -> None:
        """Replace the points, values and steps of the searches in `rows`."""
        self.point[rows], self.value[rows], self.step[rows] = searches.point, searches.value, searches.step
