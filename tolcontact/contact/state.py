"""What a group is asked to resolve, how far its steps have come, and what became of it: plain arrays."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from tolcontact.compilation import ACCURACY, SLOTS
from tolcontact.contact.slots import Slots

CARRIES = 1e-4


@dataclass(frozen=True, eq=False)
class Task:
    """What stays the same while realizations are resolved; first dimension of the arrays: the row, one for each of them.

    raw            (row, part of the group, 12)
    relative       (row, pair of the group, 12): X_RM in the raw state
    deviations     (row, locator) [mm]
    moments        (row, side, moment) of the points that count in the objective
    may_carry      for each pair of the group (row, point), or None where every point may
    """

    raw: np.ndarray
    relative: np.ndarray
    deviations: np.ndarray
    moments: np.ndarray
    may_carry: list[np.ndarray | None]

    def take(self, rows: np.ndarray) -> "Task":
        """The task for some rows."""
        may_carry = [None if mask is None else mask[rows] for mask in self.may_carry]
        return Task(self.raw[rows], self.relative[rows], self.deviations[rows], self.moments[rows], may_carry)


@dataclass(eq=False)
class State:
    """How far the steps of a task's rows have come. Steps write into the arrays.

    poses       (row, part of the group, 12)
    relative    (row, pair of the group, 12): X_RM
    residual    (row,) [mm]: KKT residual, any penetration left undone, and the last step of the exact resolution, or that step
                in the norm of the objective, if it is smaller
    slack       (row, pair of the group) [mm]: penetration that no increment could remove; where the steps came to no rest
                for it, the true penetration at the best poses on the way, which are kept
    astray      (row,) [mm]: how far two-sided locators, where they hold, are from their place at `poses`
    iterations  (row,): linear steps taken
    second_answers (row,): QPs that another solver had to answer
    multipliers (row, row of the QP): reactions in the last QP
    gap_min     (row, pair of the group) [mm]: least true gap at `poses`, once the steps have ended
    searched    (row,) bool: contact points were projected again at `poses`, onto curved faces at least
    doubtful    (row,) bool: `poses` are far from the raw ones, and what they stand on was not confirmed
    slots       the points that carry most, for the next QP to start with; one for each pair whose points in the QP change
    """

    poses: np.ndarray
    relative: np.ndarray
    residual: np.ndarray
    slack: np.ndarray
    astray: np.ndarray
    iterations: np.ndarray
    second_answers: np.ndarray
    multipliers: np.ndarray
    gap_min: np.ndarray
    searched: np.ndarray
    doubtful: np.ndarray
    slots: list[Slots]

    @property
    def in_conflict(self) -> np.ndarray:
        """(row,): whether penetration was left that no increment could remove."""
        return np.asarray((self.slack > ACCURACY).any(axis=1))

    @property
    def solved(self) -> np.ndarray:
        """(row,): whether the optimality conditions hold. A conflict is believed where it exceeds what was left undone."""
        return np.asarray(self.residual <= np.maximum(ACCURACY, self.slack.max(axis=1)))

    @property
    def rank(self) -> np.ndarray:
        """(row,): 0 where an answer is certified, 1 where it is a conflict, 2 where there is none, or a doubtful one."""
        return np.where(self.solved & ~self.doubtful, np.where(self.in_conflict, 1, 0), 2)

    @classmethod
    def start(cls, poses: np.ndarray, relative: np.ndarray, rows: int, varying: int) -> Self:
        """No step was taken; the QP has so many `rows`, and `varying` of the pairs have slots in it."""
        count, pairs = relative.shape[:2]
        return cls(
            poses=poses.copy(),
            relative=relative.copy(),
            residual=np.full(count, np.inf),
            slack=np.full((count, pairs), np.inf),
            astray=np.zeros(count),
            iterations=np.zeros(count, dtype=int),
            second_answers=np.zeros(count, dtype=int),
            multipliers=np.zeros((count, rows)),
            gap_min=np.full((count, pairs), np.nan),
            searched=np.zeros(count, dtype=bool),
            doubtful=np.zeros(count, dtype=bool),
            slots=[Slots.empty(count, SLOTS) for _ in range(varying)],
        )

    def take(self, rows: np.ndarray) -> Self:
        """A copy of some rows."""
        return type(self)(
            **{name: getattr(self, name)[rows] for name in self._arrays()}, slots=[each.take(rows) for each in self.slots]
        )

    def put(self, rows: np.ndarray, other: "State") -> None:
        """Replace some rows."""
        for name in self._arrays():
            getattr(self, name)[rows] = getattr(other, name)
        for own, each in zip(self.slots, other.slots, strict=True):
            own.put(rows, each)

    @classmethod
    def _arrays(cls) -> list[str]:
        return [field.name for field in fields(cls) if field.name != "slots"]


@dataclass(frozen=True, eq=False)
class Resolution:
    """What became of the realizations `rows` of a block, as far as one group is concerned.

    state     the rows' State in the end
    starts    (row,): how many places the steps were started from

    and of all realizations of the block:

    gap_min   (realization, state, pair of the group) [mm]: least true gap
    active    (realization, pair of the group): number of active contact points in the raw state
    """

    rows: np.ndarray
    state: State
    starts: np.ndarray
    gap_min: np.ndarray
    active: np.ndarray

    def reactions(self, spans: Sequence[slice]) -> np.ndarray:
        """Sum of the reactions of each pair, (row, pair), whose rows of the QP are `spans`."""
        return np.stack([self.state.multipliers[:, span].sum(axis=1) for span in spans], axis=1)

    def carrying(self, spans: Sequence[slice]) -> np.ndarray:
        """Number of carrying points of each pair, (row, pair); smaller reactions only oppose the regularization."""
        multipliers = self.state.multipliers
        carries = multipliers > CARRIES * multipliers.max(axis=1, initial=0)[:, None]
        return np.stack([carries[:, span].sum(axis=1) for span in spans], axis=1)
