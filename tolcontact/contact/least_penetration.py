"""The poses with the least true penetration of all Newton steps: the answer of parts that contradict each other."""

from dataclasses import dataclass

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.contact.state import State

ASTRAY_WEIGHT = 1e3  # of a locator that does not hold, beside penetration
PATIENCE = 10  # steps without a gain after which none is expected: drift and cycles of two steps gain nothing at all
MIN_GAIN = 1e-3  # of the penetration


@dataclass(eq=False)
class LeastPenetration:
    """The best poses so far.

    state      State (n); its `slack` is the true penetration of each pair
    violation  (n,) [mm] of these poses: infinite as long as none is known
    stale      (n,) number of steps that were not held back since the violation fell last
    """

    state: State
    violation: Float[Array, " n"]
    stale: Int[Array, " n"]

    @classmethod
    def unknown(cls, state: State) -> "LeastPenetration":
        """Return an object that knows no poses yet."""
        count = len(state)
        return cls(state.take(np.arange(count)), np.full(count, np.inf), np.zeros(count, dtype=int))

    @property
    def is_known(self) -> Bool[Array, " n"]:
        """(n,): whether there were poses to compare."""
        return np.isfinite(self.violation)

    @property
    def is_final(self) -> Bool[Array, " n"]:
        """(n,): whether further steps are not expected to gain."""
        return self.stale >= PATIENCE

    def look(self, state: State, penetration: Float[Array, "n pair"], *, is_held: bool) -> None:
        """Keep the poses of a state (n), with their true penetration [mm], where they are better than all before.

        `is_held` tells whether the step was held back.
        """
        candidate = state.take(np.arange(len(state)))
        candidate.slack[:] = penetration
        violation = candidate.slack.max(axis=1, initial=0) + ASTRAY_WEIGHT * candidate.astray
        gains = violation < (1 - MIN_GAIN) * self.violation
        self.stale = np.where(gains | is_held, 0, self.stale + 1)
        better = np.flatnonzero(violation < self.violation)
        self.state.put(better, candidate.take(better))
        self.violation[better] = violation[better]

    def take(self, rows: np.ndarray) -> "LeastPenetration":
        """Return what is known of some realizations."""
        return LeastPenetration(self.state.take(rows), self.violation[rows], self.stale[rows])
