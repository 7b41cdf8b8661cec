"""What a group is asked to resolve, and what became of it: plain arrays, filled as the steps go on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact.simulation.slots import Slots

CARRIES = 1e-4


@dataclass(frozen=True, eq=False)
class Task:
    """What stays the same while the realizations `rows` are resolved; first dimension of the arrays: the row.

    raw            (row, part of the group, 12)
    deviations     (row, locator) [mm]
    moments        (row, side, moment) of the points that count in the objective
    may_carry      for each pair of the group (row, point), or None where every point may
    """

    raw: np.ndarray
    deviations: np.ndarray
    moments: np.ndarray
    may_carry: list[np.ndarray | None]


@dataclass(frozen=True, eq=False)
class Resolution:
    """What became of the realizations `rows` of a block, as far as one group is concerned.

    poses       (row, part of the group, 12), corrected
    relative    (row, pair of the group, 12): X_RM, corrected
    residual    (row,) [mm]: KKT residual, any penetration left undone, and the last step of the exact resolution in the norm
                of the objective
    slack       (row, pair of the group) [mm]: penetration that no increment could remove; where the steps came to no rest
                for it, the true penetration at the best poses on the way, which are kept
    astray      (row,) [mm]: how far two-sided locators, where they hold, are from their place at `poses`
    iterations  (row,): linear steps taken
    multipliers (row, row of the QP): reactions in the last QP
    slots       the points that carry most, for the next QP to start with; one for each pair whose points in the QP change

    and of all realizations of the block:

    gap_min     (realization, state, pair of the group) [mm]: least true gap
    active      (realization, pair of the group): number of active contact points in the raw state
    """

    rows: np.ndarray
    poses: np.ndarray
    relative: np.ndarray
    residual: np.ndarray
    slack: np.ndarray
    astray: np.ndarray
    iterations: np.ndarray
    multipliers: np.ndarray
    slots: list[Slots]
    gap_min: np.ndarray
    active: np.ndarray

    def reactions(self, spans: Sequence[slice]) -> np.ndarray:
        """Sum of the reactions of each pair, (row, pair), whose rows of the QP are `spans`."""
        return np.stack([self.multipliers[:, span].sum(axis=1) for span in spans], axis=1)

    def carrying(self, spans: Sequence[slice]) -> np.ndarray:
        """Number of carrying points of each pair, (row, pair); smaller reactions only oppose the regularization."""
        carries = self.multipliers > CARRIES * self.multipliers.max(axis=1, initial=0)[:, None]
        return np.stack([carries[:, span].sum(axis=1) for span in spans], axis=1)
