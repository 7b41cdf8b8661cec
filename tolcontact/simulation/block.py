"""What a block of realizations gives, as plain arrays."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Block:
    """Realizations `start` to `start + n`; the first dimension of every array is the realization.

    deviations    (n, locator) [mm]
    poses         (n, state, part, 12): R row by row, t [mm]
    measured      (n, state, measure)
    gap_min       (n, state, pair) [mm]: least true gap (5) of all contact points at the archived poses
    active        (n, pair): number of active contact points in the raw state
    carrying      (n, pair): number of contact points that carry: with more than 1e-4 of the largest reaction
    reaction      (n, pair): sum of their reactions, in the units of the objective
    status        (n,), Status
    kkt_residual  (n,) [mm], 0 where untouched
    iterations    (n,): linear steps taken, 0 where untouched
    starts        (n,): places the steps were started from, 0 where untouched
    second_answers (n,): QPs that another solver had to answer
    searched      (n,): 1 where contact points were projected again at the corrected pose
    """

    start: int
    deviations: np.ndarray
    poses: np.ndarray
    measured: np.ndarray
    gap_min: np.ndarray
    active: np.ndarray
    carrying: np.ndarray
    reaction: np.ndarray
    status: np.ndarray
    kkt_residual: np.ndarray
    iterations: np.ndarray
    starts: np.ndarray
    second_answers: np.ndarray
    searched: np.ndarray

    def __len__(self) -> int:
        return len(self.status)
