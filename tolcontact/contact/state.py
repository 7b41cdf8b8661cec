"""What a group is asked to resolve, how far its steps have come, and what became of it: plain arrays.

Their first dimension is n: the realizations that contact touches, or some of them. `take` copies some of these, `put` writes
them back; what works on realizations takes a task and a state, and knows no other index.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import ACCURACY, SLOTS
from tolcontact.contact.scan import Scan
from tolcontact.contact.slots import Slots

CARRIES = 1e-4  # of the largest reaction of a realization: smaller ones only oppose the regularization
ANSWER = ("poses", "relative", "multipliers", "slack", "astray")


@dataclass(frozen=True, eq=False)
class Task:
    """What stays the same while realizations are resolved.

    raw            (n, part of the group, 12)
    relative       (n, pair of the group, 12): X_RM in the raw state
    deviations     (n, locator) [mm]
    moments        (n, side, moment) of the points that count in the objective
    may_carry      for each pair of the group (n, point), or None if every point may
    scans          for each pair of the group the points that may carry
    """

    raw: Float[Array, "n part 12"]
    relative: Float[Array, "n pair 12"]
    deviations: Float[Array, "n contributor"]
    moments: Float[Array, "n side moment"]
    may_carry: list[Bool[Array, "n _"] | None]
    scans: Sequence[Scan]

    def __len__(self) -> int:
        return len(self.raw)

    def take(self, some: np.ndarray) -> "Task":
        """The task of some realizations."""
        return Task(
            self.raw[some],
            self.relative[some],
            self.deviations[some],
            self.moments[some],
            [None if mask is None else mask[some] for mask in self.may_carry],
            [scan.take(some) for scan in self.scans],
        )


@dataclass(eq=False)
class State:
    """How far the steps of a task have come. Steps write into the arrays.

    poses       (n, part of the group, 12)
    relative    (n, pair of the group, 12): X_RM
    residual    (n,) [mm]: KKT residual, any penetration left undone, and the last step of the exact resolution, or that step
                in the norm of the objective, if it is smaller
    slack       (n, pair of the group) [mm]: penetration that no increment could remove
    astray      (n,) [mm]: how far two-sided locators are from where they should hold
    iterations  (n,): linear steps taken
    second_answers (n,): QPs that another solver had to answer
    multipliers (n, row of the QP): reactions
    gap_min     (n, pair of the group) [mm]: least true gap at `poses`, once they are an answer
    searched    (n,): whether contact points were projected again at `poses`
    doubtful    (n,): whether the answer is farther from the raw pose than the method believes one
    slots       of the pairs with changing points: what carried last
    """

    poses: Float[Array, "n part 12"]
    relative: Float[Array, "n pair 12"]
    residual: Float[Array, " n"]
    slack: Float[Array, "n pair"]
    astray: Float[Array, " n"]
    iterations: Int[Array, " n"]
    second_answers: Int[Array, " n"]
    multipliers: Float[Array, "n row"]
    gap_min: Float[Array, "n pair"]
    searched: Bool[Array, " n"]
    doubtful: Bool[Array, " n"]
    slots: list[Slots]

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def in_conflict(self) -> Bool[Array, " n"]:
        """(n,): whether penetration was left that no increment could remove."""
        return np.asarray((self.slack > ACCURACY).any(axis=1))

    @property
    def solved(self) -> Bool[Array, " n"]:
        """(n,): whether the optimality conditions hold. A conflict is believed if it exceeds what was left undone."""
        return np.asarray(self.residual <= np.maximum(ACCURACY, self.slack.max(axis=1)))

    @property
    def rank(self) -> Int[Array, " n"]:
        """(n,): 0 for a certified answer, 1 for a conflict, 2 if there is no answer, or a doubtful one."""
        return np.where(self.solved & ~self.doubtful, np.where(self.in_conflict, 1, 0), 2)

    @property
    def loaded(self) -> Bool[Array, "n row"]:
        """(n, row of the QP): whether its point carries."""
        return np.asarray(self.multipliers > CARRIES * self.multipliers.max(axis=1, initial=0)[:, None])

    @classmethod
    def start(cls, poses: Float[Array, "n part 12"], relative: Float[Array, "n pair 12"], rows: int, varying: int) -> "State":
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

    def take(self, some: np.ndarray) -> "State":
        """A copy of some realizations."""
        return type(self)(
            **{name: getattr(self, name)[some] for name in _ARRAYS}, slots=[each.take(some) for each in self.slots]
        )

    def put(self, some: np.ndarray, other: "State") -> None:
        """Replace some realizations."""
        for name in _ARRAYS:
            getattr(self, name)[some] = getattr(other, name)
        for own, each in zip(self.slots, other.slots, strict=True):
            own.put(some, each)

    def put_answer(self, some: np.ndarray, other: "State") -> None:
        """Replace the poses of some realizations, and what belongs to them; not the record of how they were found."""
        for name in ANSWER:
            getattr(self, name)[some] = getattr(other, name)


_ARRAYS = tuple(field.name for field in fields(State) if field.name != "slots")


class Unsettled:
    """Realizations that still move, with a task and a state of their own; those that have settled go back where they were."""

    def __init__(self, task: Task, state: State) -> None:
        self._whole, self._where = state, np.arange(len(task))
        self.task, self.state = task, state

    def __len__(self) -> int:
        return len(self._where)

    def settle(self, done: Bool[Array, " n"]) -> None:
        """Put back those that are `done` (n,), and go on with the others."""
        if not done.any():
            return
        if self.state is not self._whole:
            self._whole.put(self._where[done], self.state.take(done))
        on = ~done
        self._where, self.task, self.state = self._where[on], self.task.take(on), self.state.take(on)


@dataclass(frozen=True, eq=False)
class Resolved:
    """What became of the realizations `touched` of a block, as far as one group is concerned.

    touched   (n,): their numbers in the block
    state     their State in the end
    starts    (n,): how many places the steps were started from

    and of all realizations of the block:

    gap_min   (realization, state, pair of the group) [mm]: least true gap
    active    (realization, pair of the group): number of active contact points in the raw state
    """

    touched: Int[Array, " n"]
    state: State
    starts: Int[Array, " n"]
    gap_min: Float[Array, "realization state pair"]
    active: Int[Array, "realization pair"]

    def reactions(self, spans: Sequence[slice]) -> Float[Array, "n pair"]:
        """Sum of the reactions of each pair, (n, pair), whose rows of the QP are `spans`."""
        return np.stack([self.state.multipliers[:, span].sum(axis=1) for span in spans], axis=1)

    def carrying(self, spans: Sequence[slice]) -> Int[Array, "n pair"]:
        """Number of carrying points of each pair, (n, pair)."""
        loaded = self.state.loaded
        return np.stack([loaded[:, span].sum(axis=1) for span in spans], axis=1)
