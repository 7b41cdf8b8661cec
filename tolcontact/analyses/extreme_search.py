"""Parallel searches for extreme values of measures: the candidates of all searches are simulated in one batch.

A search is a generating set search (Kolda, Lewis, Torczon, 2003). It tries points a step away along each contributor and in
random directions, and then points on the way to the far end of the region along its slopes. It moves to the best of them if
the gain is sufficient; otherwise its step shrinks. It ends when its step is small. Searches that meet share simulated points.

A measure with contact is searched along the contributors that have an influence on it. Influences are found before a search, by
exchanging deviations between points, and again where it ends, since an influence may show only there.
"""

import math
from collections.abc import Callable

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.analyses.allowed_space import AllowedRegion
from tolcontact.analyses.analysis import Analysis
from tolcontact.analyses.searches import SHRINKAGE, Effort, Searches

RANDOM_DIRECTIONS = 4  # tried by a search at each step
END_SHARES = 0.5 ** np.arange(9)  # of the way to a far end, for trial points
WAY_SHARES = np.arange(1, 9) / 8  # of the way to a better end, at which a measure must increase
ROUNDING, STEP_GAIN = 1e-10, 0.01  # of a measure's spread: the least gain is ROUNDING + STEP_GAIN step^2
MAX_STEPS = 200
MAX_POLISHES, POLISHING_STEP, POLISHED = 3, 0.25, 0.2  # of the best searches; their first step; ratio of finest steps
POLISHING_SHARE = 0.15  # of the combinations tried so far: polishing ends after as many more
MIN_POLISH = 1e-3  # of a measure's spread: a smaller gain is no reason to continue
MAX_FINISHES = 4
MAX_RESTARTS, RESTART_STEP = 3, 0.25  # of continued searches, and their first step
NEGLIGIBLE = 1e-6  # of a measure's spread: smaller changes do not count as influence
SINGLE = 2  # points with exchanges of one contributor at a time
MAX_EXCHANGES = 8
DIFFERENCE_STEP = 1e-4  # of the ranges, for slopes at an end


class Evaluation:
    """Measures at points of the region (see AllowedRegion). No point is simulated twice.

    is_undefined  (measure,): whether a measure was not a finite number at any point, raw or certified
    """

    def __init__(self, analysis: Analysis, region: AllowedRegion) -> None:
        self._analysis, self._region = analysis, region
        self.is_undefined = np.zeros(len(analysis.program.nominal.measures), dtype=bool)
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
            measured, status = self._analysis.simulate_deviations(deviations[list(rows.values())])
            unresolved = np.isin(status, terms.UNRESOLVED)
            self._record_undefined(measured[:, terms.RAW])
            self._record_undefined(measured[~unresolved, terms.CORRECTED])
            measured[unresolved, terms.CORRECTED] = np.nan
            self._known.update(zip(rows, measured, strict=True))
        return self._shaped(np.array([self._known[key] for key in keys]), points)

    def raw(self, points: np.ndarray) -> np.ndarray:
        """Return the same with raw measures only, which takes no time; the corrected ones are NaN."""
        program, deviations = self._analysis.program, self._deviations(points)
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


class Searcher:
    """Moves searches in a region, along contributors with a known influence on a measure with contact.

    Influences are found by exchanging deviations between points. Contributors that vary jointly, such as the components of a
    feature in a zone, are exchanged jointly, so that the resulting points also lie in the region. Contributors without
    influence anywhere are identified by exchanging all of them at once.

    spread     (measure,) difference between the largest and the least value of random points
    is_active  (measure, contributor): whether an influence is known; other contributors do not change
    """

    def __init__(
        self, region: AllowedRegion, evaluation: Evaluation, spread: np.ndarray, rng: np.random.Generator, effort: Effort
    ) -> None:  # fmt: skip
        self._region, self._evaluation, self._spread, self._rng = region, evaluation, spread, rng
        self._effort, self._units = effort, region.independent_columns
        self.is_active = np.zeros((len(spread), len(region.lower)), dtype=bool)
        self._ranges = np.zeros(len(region.lower))
        self._ranges[region.moves] = (region.upper - region.lower)[region.moves]
        self._compass = np.diag(self._ranges)[region.moves]

    def run(self, searches: Searches, advanced: Callable[[float], None], partners: np.ndarray) -> Searches:
        """Search, and return the best search for each extreme value.

        If an exchange with partners (n, contributor) at an end shows an influence of further contributors, the searches of that
        measure also continue along these.
        """
        for _ in range(MAX_RESTARTS):
            self._search(searches, advanced)
            self._meet(searches)
            best = searches.best_of(self._effort.searches)
            points = np.repeat(best.point[best.state == terms.CORRECTED], len(partners), axis=0)
            is_new = self.explore(points, np.resize(partners, points.shape))
            rows = np.flatnonzero(is_new[searches.measure] & (searches.state == terms.CORRECTED))
            if not rows.size:
                break
            searches.step[rows] = RESTART_STEP
        self._polish(best)
        return best

    def explore(self, points: np.ndarray, partners: np.ndarray) -> np.ndarray:
        """Find influences at points (n, contributor), by exchange with partners (n, contributor).

        Return whether a new influence was found, (measure,).
        """
        before = self.is_active.copy()
        for _ in range(MAX_EXCHANGES):
            hits = self._hidden(points, partners)
            if not hits.any():
                break
            rows = np.flatnonzero(hits.any(axis=1))[:SINGLE]
            unchanged = self.is_active.copy()
            self._explore_one_at_a_time(points[rows], partners[rows])
            interacts = hits[rows].any(axis=0) & (self.is_active == unchanged).all(axis=1)
            self.is_active[interacts] = True
        else:
            self.is_active[hits.any(axis=0)] = True
        return np.asarray((self.is_active != before).any(axis=1))

    def _hidden(self, points: np.ndarray, partners: np.ndarray) -> np.ndarray:
        """Return whether a joint exchange of all contributors without known influence changes a measure, (n, measure)."""
        mixed = np.where(self.is_active[:, None], points, partners)
        changes = self._changes(self._corrected(points)[None], self._corrected(mixed))
        return np.asarray(changes[np.arange(len(mixed)), :, np.arange(len(mixed))].T)

    def _explore_one_at_a_time(self, points: np.ndarray, partners: np.ndarray) -> None:
        """Mark contributors as active if their exchange changes a measure at any of the points (n, contributor)."""
        mixed = np.repeat(points[:, None], len(self._units), axis=1)
        for unit, columns in enumerate(self._units):
            mixed[:, unit, columns] = partners[:, columns]
        changes = np.any(self._changes(self._corrected(points)[:, None], self._corrected(mixed)), axis=0)
        for unit, columns in enumerate(self._units):
            self.is_active[np.ix_(np.flatnonzero(changes[unit]), columns)] = True

    def _corrected(self, points: np.ndarray) -> np.ndarray:
        return self._evaluation.corrected(points)[..., terms.CORRECTED, :]

    def _changes(self, values: np.ndarray, exchanged: np.ndarray) -> np.ndarray:
        """Return whether measures (..., measure) differ, including where only one of them is certified."""
        with np.errstate(invalid="ignore"):
            return np.asarray(
                (np.abs(values - exchanged) > NEGLIGIBLE * self._spread) | (np.isnan(values) != np.isnan(exchanged))
            )

    def _search(
        self, searches: Searches, advanced: Callable[[float], None] = lambda share: None, *, fineness: float = 1.0,
        limit: float = math.inf,
    ) -> None:  # fmt: skip
        """Move until all steps are small. `advanced` is called with the finished share of the search.

        fineness   factor of the finest step
        limit      number of combinations at which the search ends
        """
        finest_step = self._effort.finest_step * fineness
        for _ in range(MAX_STEPS):
            rows = np.flatnonzero(searches.step > finest_step)
            if not rows.size or self._evaluation.count > limit:
                break
            active = searches.take(rows)
            candidates, values, slopes = self._neighbours(active, active.step, self._random_steps())
            gains = self._move(active, candidates, values)
            gains |= self._move_towards(active, self._region.farthest(slopes))
            active.step[~gains] *= SHRINKAGE
            searches.put(rows, active)
            steps = np.log(np.maximum(searches.step, finest_step)[searches.state == terms.CORRECTED])
            advanced(float(steps.mean() / math.log(finest_step)))

    def _polish(self, searches: Searches) -> None:
        """Continue the searches with contact until they gain no more, or have cost too much."""
        limit = (1 + POLISHING_SHARE) * self._evaluation.count
        for _ in range(MAX_POLISHES):
            values = searches.value.copy()
            searches.step[searches.state == terms.CORRECTED] = POLISHING_STEP
            self._search(searches, fineness=POLISHED, limit=limit)
            gains = searches.value > values + MIN_POLISH * self._spread[searches.measure]
            if not gains.any() or self._evaluation.count > limit:
                break
        self._finish(searches, limit)

    def _meet(self, searches: Searches) -> None:
        """Move searches with contact to the best one of their goal if the measure grows all the way there."""
        count = self._effort.searches
        best = np.repeat(searches.best_of(count).point, count, axis=0)
        rows = np.flatnonzero((searches.state == terms.CORRECTED) & (searches.point != best).any(axis=1))
        if rows.size:
            behind = searches.take(rows)
            ways = behind.point[:, None] + WAY_SHARES[:, None] * (best[rows] - behind.point)[:, None]
            ways[:, :, self._region.fixed] = best[rows][:, None, self._region.fixed]
            values = np.column_stack([behind.value, self._values_at(behind, ways)])
            ends = np.flatnonzero((np.diff(values, axis=1) >= -ROUNDING * self._spread[behind.measure][:, None]).all(axis=1))
            behind.point[ends], behind.value[ends] = ways[ends, -1], values[ends, -1]
            searches.put(rows, behind)

    def _finish(self, searches: Searches, limit: float) -> None:
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

    def _values_at(self, searches: Searches, candidates: np.ndarray) -> np.ndarray:
        """Return the values (n, candidate) of candidates (n, candidate, contributor) for searches."""
        values = np.empty(candidates.shape[:2])
        for state, evaluate in ((terms.RAW, self._evaluation.raw), (terms.CORRECTED, self._evaluation.corrected)):
            rows = np.flatnonzero(searches.state == state)
            if rows.size:
                measured = evaluate(candidates[rows])[np.arange(len(rows)), :, state, searches.measure[rows]]
                values[rows] = np.nan_to_num(searches.sense[rows, None] * measured, nan=-np.inf)
        return values

    def _move(self, searches: Searches, candidates: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Move each search to the best of its candidates (n, candidate, contributor) if it gains enough.

        The least gain is a forcing function, which grows with the step to prevent slow progress. Return whether each search
        moved, (n,).
        """
        min_gain = self._spread[searches.measure] * (ROUNDING + STEP_GAIN * searches.step**2)
        rows, best = np.arange(len(values)), values.argmax(axis=1)
        gains = values[rows, best] > searches.value + min_gain
        searches.point[gains], searches.value[gains] = candidates[rows, best][gains], values[rows, best][gains]
        return np.asarray(gains)

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
        steps *= (self.is_active[searches.measure] | (searches.state == terms.RAW)[:, None])[:, None]
        candidates = self._region.stepped(searches.point, steps)
        values = self._values_at(searches, candidates)
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
        return self._move(searches, candidates, self._values_at(searches, candidates))
