"""Parallel searches for extreme values of measures: the candidates of all searches are simulated in one batch.

A search is a generating set search (Kolda, Lewis, Torczon, 2003). It tries points a step away along each contributor and in
random directions, and then points on the way to the far end of the region along its slopes. It moves to the best of them if
the gain is sufficient; otherwise its step shrinks. It ends when its step is small. Searches that meet share simulated points.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.analyses.allowed_space import AllowedRegion
from tolcontact.analyses.analysis import Engine

RANDOM_DIRECTIONS = 4  # tried by a search at each step
END_SHARES = 0.5 ** np.arange(9)  # of the way to a far end, for trial points
WAY_SHARES = np.arange(1, 9) / 8  # of the way to a better end, at which a measure must increase
SHRINKAGE = 0.25  # of a step
ROUNDING, STEP_GAIN = 1e-10, 0.01  # of a measure's spread: the least gain is ROUNDING + STEP_GAIN step^2
MAX_STEPS = 200
MAX_POLISHES, POLISHING_STEP, POLISHED = 3, 0.25, 0.2  # of the best searches; their first step; ratio of finest steps
POLISHING_SHARE = 0.15  # of the combinations tried so far: polishing ends after as many more
MIN_POLISH = 1e-3  # of a measure's spread: a smaller gain is no reason to continue
MAX_FINISHES = 4
DIFFERENCE_STEP = 1e-4  # of the ranges, for slopes at an end


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


class Evaluation:
    """Measures at points of the region (see AllowedRegion). No point is simulated twice.

    is_undefined  (measure,): whether a measure was not a finite number at any point, raw or certified
    """

    def __init__(self, engine: Engine, region: AllowedRegion) -> None:
        self._engine, self._region = engine, region
        self.is_undefined = np.zeros(len(engine.program.nominal.measures), dtype=bool)
        self._known: dict[bytes, np.ndarray] = {}

    @property
    def count(self) -> int:
        """The number of points simulated so far."""
        return len(self._known)

    def corrected(self, points: np.ndarray) -> np.ndarray:
        """Return measures (..., state, measure) at points (..., contributor); corrected ones are NaN if not certified."""
        deviations = self._deviations(points) + 0.0  # no negative zeros
        keys = [row.tobytes() for row in deviations]
        rows = {key: row for row, key in enumerate(keys) if key not in self._known}
        if rows:
            measured, status = self._engine.simulate_deviations(deviations[list(rows.values())])
            unresolved = np.isin(status, terms.UNRESOLVED)
            self._record_undefined(measured[:, terms.RAW])
            self._record_undefined(measured[~unresolved, terms.CORRECTED])
            measured[unresolved, terms.CORRECTED] = np.nan
            self._known.update(zip(rows, measured, strict=True))
        return self._shaped(np.array([self._known[key] for key in keys]), points)

    def raw(self, points: np.ndarray) -> np.ndarray:
        """Return the same with raw measures only, which takes no time; the corrected ones are NaN."""
        program, deviations = self._engine.program, self._deviations(points)
        measured = program.observe(poses=program.place(deviations=deviations)["poses"], deviations=deviations)["measured"]
        self._record_undefined(measured)
        return self._shaped(np.stack([measured, np.full_like(measured, np.nan)], axis=1), points)

    def _shaped(self, measured: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return measures (..., state, measure) at points (..., contributor), of which there may be none."""
        return measured.reshape(*points.shape[:-1], len(terms.STATES), len(self.is_undefined))

    def _record_undefined(self, measured: np.ndarray) -> None:
        """Record which measures (n, measure) are not finite numbers."""
        self.is_undefined |= ~np.isfinite(measured).all(axis=0)

    def _deviations(self, points: np.ndarray) -> np.ndarray:
        return self._region.deviations(points.reshape(-1, points.shape[-1]))


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
        searches, ones = [], np.ones(effort.best + effort.random, dtype=int)
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

    def values_at(self, candidates: np.ndarray, evaluation: Evaluation) -> np.ndarray:
        """Return the values (n, candidate) of candidates (n, candidate, contributor)."""
        values = np.empty(candidates.shape[:2])
        for state, evaluate in ((terms.RAW, evaluation.raw), (terms.CORRECTED, evaluation.corrected)):
            rows = np.flatnonzero(self.state == state)
            if rows.size:
                measured = evaluate(candidates[rows])[np.arange(len(rows)), :, state, self.measure[rows]]
                values[rows] = np.nan_to_num(self.sense[rows, None] * measured, nan=-np.inf)
        return values

    def move(self, candidates: np.ndarray, values: np.ndarray, min_gain: np.ndarray) -> np.ndarray:
        """Move each search to the best of its candidates (n, candidate, contributor) if the gain exceeds `min_gain` (n,).

        Return whether each search moved, (n,).
        """
        rows, best = np.arange(len(values)), values.argmax(axis=1)
        gains = values[rows, best] > self.value + min_gain
        self.point[gains], self.value[gains] = candidates[rows, best][gains], values[rows, best][gains]
        return np.asarray(gains)


class Searcher:
    """Moves searches in a region.

    spread     (measure,) difference between the largest and the least value of random points
    is_active  (measure, contributor): contributors along which a measure with contact is searched; others do not change
    """

    def __init__(
        self, region: AllowedRegion, evaluation: Evaluation, spread: np.ndarray, is_active: np.ndarray,
        rng: np.random.Generator, finest_step: float,
    ) -> None:  # fmt: skip
        self._region, self._evaluation, self._spread, self._rng = region, evaluation, spread, rng
        self._is_active, self._finest_step = is_active, finest_step
        self._ranges = np.zeros(len(region.lower))
        self._ranges[region.moves] = (region.upper - region.lower)[region.moves]
        self._compass = np.diag(self._ranges)[region.moves]

    def search(
        self, searches: Searches, advanced: Callable[[float], None] = lambda share: None, *, fineness: float = 1.0,
        limit: float = math.inf,
    ) -> None:  # fmt: skip
        """Move until all steps are small. `advanced` is called with the finished share of the search.

        fineness   factor of the finest step
        limit      number of combinations at which the search ends
        """
        finest_step = self._finest_step * fineness
        for _ in range(MAX_STEPS):
            rows = np.flatnonzero(searches.step > finest_step)
            if not rows.size or self._evaluation.count > limit:
                break
            active = searches.take(rows)
            candidates, values, slopes = self._neighbours(active, active.step, self._random_steps())
            gains = active.move(candidates, values, self._min_gain(active))
            gains |= self._move_towards(active, self._region.farthest(slopes))
            active.step[~gains] *= SHRINKAGE
            searches.put(rows, active)
            steps = np.log(np.maximum(searches.step, finest_step)[searches.state == terms.CORRECTED])
            advanced(float(steps.mean() / math.log(finest_step)))

    def polish(self, searches: Searches) -> None:
        """Continue the searches with contact until they gain no more, or have cost too much."""
        limit = (1 + POLISHING_SHARE) * self._evaluation.count
        for _ in range(MAX_POLISHES):
            values = searches.value.copy()
            searches.step[searches.state == terms.CORRECTED] = POLISHING_STEP
            self.search(searches, fineness=POLISHED, limit=limit)
            gains = searches.value > values + MIN_POLISH * self._spread[searches.measure]
            if not gains.any() or self._evaluation.count > limit:
                break
        self.finish(searches, limit)

    def meet(self, searches: Searches, count: int) -> None:
        """Move searches with contact to the best of `count` consecutive ones if the measure grows all the way there."""
        best = np.repeat(searches.best_of(count).point, count, axis=0)
        rows = np.flatnonzero((searches.state == terms.CORRECTED) & (searches.point != best).any(axis=1))
        if rows.size:
            behind = searches.take(rows)
            ways = behind.point[:, None] + WAY_SHARES[:, None] * (best[rows] - behind.point)[:, None]
            ways[:, :, self._region.fixed] = best[rows][:, None, self._region.fixed]
            values = np.column_stack([behind.value, behind.values_at(ways, self._evaluation)])
            ends = np.flatnonzero((np.diff(values, axis=1) >= -ROUNDING * self._spread[behind.measure][:, None]).all(axis=1))
            behind.point[ends], behind.value[ends] = ways[ends, -1], values[ends, -1]
            searches.put(rows, behind)

    def finish(self, searches: Searches, limit: float) -> None:
        """Move along the slopes to the exact end of round zones; only once if more combinations than `limit` were tried."""
        searches.step[:] = 0.0
        for _ in range(MAX_FINISHES):
            steps = np.full(len(searches.value), DIFFERENCE_STEP)
            _, _, slopes = self._neighbours(searches, steps, np.zeros((0, len(self._ranges))))
            ends = [
                self._region.exactly_farthest(row) if row.any() else point
                for row, point in zip(slopes, searches.point, strict=True)
            ]
            if not self._move_towards(searches, np.array(ends)).any() or self._evaluation.count > limit:
                return

    def _min_gain(self, searches: Searches) -> np.ndarray:
        """Return the least gain (n,) of a step: a forcing function, which grows with the step to prevent slow progress."""
        return np.asarray(self._spread[searches.measure] * (ROUNDING + STEP_GAIN * searches.step**2))

    def _random_steps(self) -> np.ndarray:
        """Return steps (direction, contributor) of length 1 in shares of the ranges."""
        shares = self._rng.standard_normal((RANDOM_DIRECTIONS, len(self._ranges))) * (self._ranges > 0)
        return np.asarray(shares / np.maximum(np.linalg.norm(shares, axis=1, keepdims=True), 1e-300) * self._ranges)

    def _neighbours(
        self, searches: Searches, step: np.ndarray, directions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the points a step (n,) away, limited to the region, their values, and the slopes between them.

        Points (n, candidate, contributor) lie along each contributor, and along `directions` (direction, contributor), in both
        senses. Slopes (n, contributor) come from the differences along contributors; they are 0 where undefined.
        """
        steps = step[:, None, None] * np.vstack([self._compass, -self._compass, directions, -directions])
        steps *= (self._is_active[searches.measure] | (searches.state == terms.RAW)[:, None])[:, None]
        candidates = self._region.stepped(searches.point, steps)
        values = searches.values_at(candidates, self._evaluation)
        up, down = slice(0, len(self._compass)), slice(len(self._compass), 2 * len(self._compass))
        distances = (candidates[:, up] - candidates[:, down])[:, :, self._region.moves].diagonal(axis1=1, axis2=2)
        with np.errstate(invalid="ignore", divide="ignore"):
            rise = np.where(distances != 0, (values[:, up] - values[:, down]) / distances, 0.0)
        slopes = np.zeros_like(searches.point)
        slopes[:, self._region.moves] = np.where(np.isfinite(rise), rise, 0.0)
        return candidates, values, slopes

    def _move_towards(self, searches: Searches, ends: np.ndarray) -> np.ndarray:
        """Move a share of the way to far ends (n, contributor), if the gain suffices. Return whether each search moved, (n,).

        Measured parts are always taken from the far end, since there are no values between their rows.
        """
        candidates = searches.point[:, None] + END_SHARES[:, None] * (ends - searches.point)[:, None]
        candidates[:, :, self._region.fixed] = ends[:, None, self._region.fixed]
        return searches.move(candidates, searches.values_at(candidates, self._evaluation), self._min_gain(searches))
