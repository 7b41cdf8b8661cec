"""Searches for extreme values on the engine, side by side: what is tried of all of them is simulated together."""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.analyses.allowed_space import Region
from tolcontact.compilation import Program
from tolcontact.simulation import outcomes
from tolcontact.simulation.cluster import MapBlocks
from tolcontact.variation import GivenDraws

AROUND = 8  # random directions that a search tries, beside those of single contributors
SHARES = 0.5 ** np.arange(9)  # of the way to a far end that are tried
SHRINK, FINEST = 0.25, 1e-7  # of a search's step, in shares of the ranges
GAIN, ENOUGH = 1e-10, 0.01  # of a measure's spread: less is rounding; and, times the square of a step, no progress
ROUNDS = 200  # steps of a search at most
FINISHES = 4
NEAR = 1e-4  # of the ranges: steps of differences at an end


class Evaluation:
    """The engine on own deviations, and how many of each status it has seen."""

    def __init__(self, program: Program, region: Region, blocks: MapBlocks) -> None:
        self._program, self._region, self._blocks = program, region, blocks
        self.statuses = np.zeros(len(terms.STATUS_MEANINGS), dtype=int)

    def __call__(self, own: np.ndarray) -> np.ndarray:
        """Measures (..., state, measure) of own deviations (..., contributor); NaN, corrected, where it is not certified."""
        flat = self._region.deviations(own.reshape(-1, own.shape[-1]))
        values = []
        for measured, status in self._blocks(outcomes, self._program, samples=len(flat), seed=0, draws=GivenDraws(flat)):
            measured[np.isin(status, terms.UNRESOLVED), terms.CORRECTED] = np.nan
            values.append(measured)
            self.statuses += np.bincount(status, minlength=len(self.statuses))
        return np.concatenate(values).reshape(*own.shape[:-1], len(terms.STATES), -1)

    def raw(self, own: np.ndarray) -> np.ndarray:
        """The same without contact, which takes no time: NaN, corrected."""
        flat = self._region.deviations(own.reshape(-1, own.shape[-1]))
        measured = self._program.observe(poses=self._program.place(deviations=flat)["poses"], deviations=flat)["measured"]
        return np.stack([measured, np.full_like(measured, np.nan)], axis=1).reshape(*own.shape[:-1], len(terms.STATES), -1)


@dataclass(eq=False)
class Searches:
    """What each looks for, where it is, how good that is, how far it steps.

    sense, state, measure  (n,): +1 for the largest, -1 for the least value, of a measure in a state
    own                    (n, contributor)
    value                  (n,): sense times the measure
    step                   (n,): in shares of the ranges
    """

    sense: np.ndarray
    state: np.ndarray
    measure: np.ndarray
    own: np.ndarray
    value: np.ndarray
    step: np.ndarray

    @classmethod
    def begun(cls, starts: np.ndarray, seen: np.ndarray, best: int, others: int, rng: np.random.Generator) -> "Searches":
        """Some for each measure, state and sense: from the best starts (n, contributor), with measures (n, state, measure), and
        from others at random."""
        count = best + others
        every = []
        for measure in range(seen.shape[2]):
            for state in range(seen.shape[1]):
                for sense in terms.SENSES:
                    values = np.nan_to_num(sense * seen[:, state, measure], nan=-np.inf)
                    order, same = np.argsort(-values, kind="stable"), np.ones(count, dtype=int)
                    rest = order[best : max(int(np.isfinite(values).sum()), best + 1)]
                    chosen = np.concatenate([order[:best], rng.choice(rest, others)])
                    every.append(cls(sense * same, state * same, measure * same, starts[chosen], values[chosen], 1.0 * same))
        return cls(*(np.concatenate([getattr(each, field.name) for each in every]) for field in fields(cls)))

    def take(self, rows: np.ndarray) -> "Searches":
        """Some of them, as copies."""
        return Searches(*(getattr(self, field.name)[rows] for field in fields(self)))

    def put(self, rows: np.ndarray, some: "Searches") -> None:
        """Take over where some of them got to."""
        self.own[rows], self.value[rows], self.step[rows] = some.own, some.value, some.step

    def worth(self, own: np.ndarray, evaluate: Evaluation) -> np.ndarray:
        """What own deviations (n, candidate, contributor) are worth (n, candidate)."""
        found = np.empty(own.shape[:2])
        for state, seen in ((terms.RAW, evaluate.raw), (terms.CORRECTED, evaluate)):
            rows = np.flatnonzero(self.state == state)
            if rows.size:
                measured = seen(own[rows])[np.arange(len(rows)), :, state, self.measure[rows]]
                found[rows] = np.nan_to_num(self.sense[rows, None] * measured, nan=-np.inf)
        return found

    def move(self, candidates: np.ndarray, worth: np.ndarray, least: np.ndarray) -> np.ndarray:
        """Move to the best of own deviations (n, candidate, contributor) if it gains more than `least` (n,): which did (n,)."""
        rows, best = np.arange(len(worth)), worth.argmax(axis=1)
        gains = worth[rows, best] > self.value + least
        self.own[gains], self.value[gains] = candidates[rows, best][gains], worth[rows, best][gains]
        return np.asarray(gains)


class Searcher:
    """Moves searches in a region. `spread` (measure,): how much measures differ there."""

    def __init__(self, region: Region, evaluate: Evaluation, spread: np.ndarray, rng: np.random.Generator) -> None:
        self._region, self._evaluate, self._spread, self._rng = region, evaluate, spread, rng
        self._ranges = np.zeros(len(region.lower))
        self._ranges[region.moves] = (region.upper - region.lower)[region.moves]
        self._compass = np.diag(self._ranges)[region.moves]

    def search(self, searches: Searches, progress: Callable[[int, int], None] | None) -> None:
        """Go on until all steps are small (a generating set search). `progress` is told how many ended, and of how many."""
        for _ in range(ROUNDS):
            going = np.flatnonzero(searches.step > FINEST)
            if not going.size:
                break
            now = searches.take(going)
            there, worth, slopes = self._around(now, now.step, self._random())
            gains = now.move(there, worth, self._least(now))
            gains |= self._go_far(now, self._region.farthest(slopes))
            now.step[~gains] *= SHRINK
            searches.put(going, now)
            if progress:
                progress(int((searches.step <= FINEST).sum()), len(searches.step))

    def finish(self, searches: Searches) -> None:
        """Go to the very end of round zones, along the slopes."""
        searches.step[:] = 0.0
        for _ in range(FINISHES):
            _, _, slopes = self._around(searches, np.full(len(searches.value), NEAR), np.zeros((0, len(self._ranges))))
            ends = [
                self._region.exactly_farthest(row) if row.any() else own for row, own in zip(slopes, searches.own, strict=True)
            ]
            if not self._go_far(searches, np.array(ends)).any():
                return

    def _least(self, searches: Searches) -> np.ndarray:
        """What a step has to gain (n,): the more the longer it is, so that searches do not creep (a forcing function)."""
        return np.asarray(self._spread[searches.measure] * (GAIN + ENOUGH * searches.step**2))

    def _random(self) -> np.ndarray:
        """Steps (direction, contributor) of length 1 in shares of the ranges."""
        shares = self._rng.standard_normal((AROUND, len(self._ranges))) * (self._ranges > 0)
        return np.asarray(shares / np.maximum(np.linalg.norm(shares, axis=1, keepdims=True), 1e-300) * self._ranges)

    def _around(self, searches: Searches, step: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Own deviations (n, candidate, contributor) a step (n,) away, as far as the region lets them, what they are worth,
        and slopes (n, contributor) between those of single contributors."""
        steps = step[:, None, None] * np.vstack([self._compass, -self._compass, others, -others])
        n, count, width = steps.shape
        own, flat = np.repeat(searches.own, count, axis=0), steps.reshape(-1, width)
        there = (own + self._region.reach(own, flat)[:, None] * flat).reshape(n, count, width)
        worth = searches.worth(there, self._evaluate)
        up, down = slice(0, len(self._compass)), slice(len(self._compass), 2 * len(self._compass))
        apart = (there[:, up] - there[:, down])[:, :, self._region.moves].diagonal(axis1=1, axis2=2)
        with np.errstate(invalid="ignore", divide="ignore"):
            rise = np.where(apart > 0, (worth[:, up] - worth[:, down]) / apart, 0.0)
        slopes = np.zeros_like(searches.own)
        slopes[:, self._region.moves] = np.where(np.isfinite(rise), rise, 0.0)
        return there, worth, slopes

    def _go_far(self, searches: Searches, ends: np.ndarray) -> np.ndarray:
        """Go some share of the way to far ends (n, contributor), if it gains: which did (n,). Of measured parts it is those at
        the end, whatever the share."""
        there = searches.own[:, None] + SHARES[:, None] * (ends - searches.own)[:, None]
        fixed = np.setdiff1d(self._region.varies, self._region.moves)
        there[:, :, fixed] = ends[:, None, fixed]
        return searches.move(there, searches.worth(there, self._evaluate), self._least(searches))
