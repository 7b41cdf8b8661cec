"""The engine of all analyses: it simulates realizations in blocks, collects observations and counts statuses."""

import threading
from collections.abc import Callable
from concurrent.futures import CancelledError
from typing import Any

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.analyses.designs import Design
from tolcontact.compilation import Program
from tolcontact.simulation import Block, block_rows, outcomes
from tolcontact.simulation.cluster import MapBlocks
from tolcontact.simulation.threads import Sampler
from tolcontact.variation import GivenDraws

MAX_ROWS_OF_BODIES = 8192  # realizations of a block, times the bodies that contact couples: a block ends within seconds
MIN_BLOCKS = 8  # for few realizations, so that they occupy all processors
VERIFICATION_FACTOR = 4  # realizations of a fresh run, in multiples of samples

Progress = Callable[[int, int], None]  # called with the number of finished steps, and the total
Observer = Callable[[Block], tuple[Any, ...]]  # returns arrays of a block; the last one is the statuses (n,)


class SharedProgress:
    """The common progress of several engines in different threads.

    has_ended   whether engines that are still simulating must stop
    """

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._total = progress, total
        self._finished: list[int] = []
        self._lock = threading.Lock()
        self.has_ended = False

    def for_engine(self) -> Progress:
        """Return the progress function of a further engine. It raises CancelledError after the end."""
        number = len(self._finished)
        self._finished.append(0)

        def report(finished: int, _: int) -> None:
            if self.has_ended:
                raise CancelledError
            with self._lock:
                self._finished[number] = finished
                if self._progress:
                    self._progress(min(sum(self._finished), self._total), self._total)

        return report


class Engine:
    """Simulations of a program.

    statuses  (status_meaning,) int: number of realizations simulated so far, by their status
    total     number of realizations that `progress` refers to; an analysis may revise it
    """

    def __init__(self, program: Program, blocks: MapBlocks, *, progress: Progress | None = None, total: int = 0) -> None:
        self.program = program
        bodies = max((len(group.group.free) for group in program.groups), default=0)
        self._rows = min(block_rows(program), max(MAX_ROWS_OF_BODIES // max(bodies, 1), MIN_BLOCKS))
        self.statuses = np.zeros(len(terms.STATUS_MEANINGS), dtype=int)
        self._blocks, self._progress, self.total = blocks, progress, total

    @property
    def simulated(self) -> int:
        """The number of realizations so far."""
        return int(self.statuses.sum())

    @property
    def unresolved(self) -> int:
        """The number of realizations so far that were not resolved."""
        return int(self.statuses[list(terms.UNRESOLVED)].sum())

    def simulate(
        self, samples: int, *, seed: int = 0, start: int = 0, draws: Sampler | None = None, observe: Observer = outcomes
    ) -> tuple[np.ndarray, ...]:
        """Simulate `samples` realizations, starting with number `start`, and return the joined results of `observe`.

        By default these are measures (n, state, measure) and statuses (n,). `draws` replaces the draws of the program.
        """
        observed = []
        block = min(self._rows, max(self._rows, samples) // MIN_BLOCKS)  # for any number of threads or workers
        for arrays in self._blocks(
            observe, self.program, samples=start + samples, start=start, seed=seed, draws=draws, block=block
        ):
            observed.append(arrays)
            self.statuses += np.bincount(arrays[-1], minlength=len(self.statuses))
            if self._progress:
                self._progress(min(self.simulated, self.total), self.total)
        return tuple(np.concatenate(column) for column in zip(*observed, strict=True))

    def simulate_deviations(self, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return measures (n, state, measure) and statuses (n,) of deviations (n, contributor)."""
        measured, status = self.simulate(len(deviations), draws=GivenDraws(deviations))
        return measured, status

    def simulate_design(
        self, design: Design, samples: int, *, seed: int, start: int = 0, observe: Observer = outcomes
    ) -> tuple[np.ndarray, ...]:
        """Return the results of `observe` for `samples` base realizations of a design, as arrays (base, realization, ...).

        The first base realization has the number `start`.
        """
        arrays = self.simulate(samples * design.size, seed=seed, start=start * design.size, draws=design, observe=observe)
        return tuple(array.reshape(samples, len(array) // samples, *array.shape[1:]) for array in arrays)
