"""The progress of repeated steps: the smallest true penetration and the smallest step so far, and when they last fell."""

from dataclasses import dataclass

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.contact.state import State

ASTRAY_WEIGHT = 1e3  # of a locator that does not hold, relative to penetration
PATIENCE_IN_CONFLICT, MIN_GAIN = 10, 1e-3  # steps without less penetration, and the share of it that counts as less
PATIENCE, MIN_CALMING = 20, 0.1  # steps that are not smaller than all before, and the share that counts as smaller


@dataclass(eq=False)
class Progress:
    """The best state reached, and the number of full steps without improvement.

    best       State (n) of smallest true penetration; its `slack` is the penetration of each pair
    violation  (n,) [mm] of these poses
    stale      (n,) number of steps since the violation fell
    unrest     (n,) [mm]: the smallest step
    restless   (n,) number of steps since then
    """

    best: State
    violation: Float[Array, " n"]
    stale: Int[Array, " n"]
    unrest: Float[Array, " n"]
    restless: Int[Array, " n"]

    @classmethod
    def start(cls, state: State) -> "Progress":
        """Return the progress before the first look."""
        count = len(state)
        violation, unrest = np.full((2, count), np.inf)
        stale, restless = np.zeros((2, count), dtype=int)
        return cls(state.take(np.arange(count)), violation, stale, unrest, restless)

    def is_over(self, in_conflict: Bool[Array, " n"]) -> Bool[Array, " n"]:
        """Return whether further steps are not expected to gain (n,): drift, cycles and chaos gain nothing at all."""
        return np.where(in_conflict, self.stale >= PATIENCE_IN_CONFLICT, self.restless >= PATIENCE)

    def look(self, state: State, penetration: Float[Array, "n pair"], unrest: Float[Array, " n"], *, is_held: bool) -> None:
        """Keep the poses of a state (n), with their true penetration [mm], where they are better than all before.

        unrest    (n,) [mm]: the size of the step
        is_held   whether the step was held back
        """
        violation = penetration.max(axis=1, initial=0) + ASTRAY_WEIGHT * state.astray
        falls, calms = violation < (1 - MIN_GAIN) * self.violation, unrest < (1 - MIN_CALMING) * self.unrest
        self.stale = np.where(falls | is_held, 0, self.stale + 1)
        self.restless = np.where(calms | is_held, 0, self.restless + 1)
        better = np.flatnonzero(violation < self.violation)
        candidate = state.take(better)
        candidate.slack[:] = penetration[better]
        self.best.put(better, candidate)
        self.violation[better] = violation[better]
        self.unrest = np.minimum(self.unrest, unrest)

    def take(self, rows: np.ndarray) -> "Progress":
        """Return the progress of some realizations."""
        return Progress(self.best.take(rows), self.violation[rows], self.stale[rows], self.unrest[rows], self.restless[rows])
