"""The task of a group, the state of its steps, and the outcome: plain arrays.

Their first dimension is n: the realizations that contact touches, or some of them. `take` copies rows of these, `put` writes
them back. Code that works on realizations takes a task and a state, and uses no other index.
"""

import enum
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import ACCURACY
from tolcontact.contact.record import Record, initial_numbers
from tolcontact.contact.scan import Scan
from tolcontact.contact.slots import Slots
from tolcontact.discretization import ContactPoints

LOADED_SHARE = 1e-4  # of the largest reaction of a realization: smaller ones only oppose the regularization
ANSWER = ("poses", "relative", "multipliers", "slack", "astray")


class Outcome(enum.IntEnum):
    """The outcome of a realization in one group, in ascending order of severity: the worst of all groups decides its status."""

    UNTOUCHED = 0
    RESOLVED = 1
    IN_CONFLICT = 2
    DOUBTFUL = 3
    UNSOLVED = 4


@dataclass(frozen=True, eq=False)
class Task:
    """The constants of realizations while they are resolved.

    raw            (n, part of the group, 12)
    relative       (n, pair of the group, 12): X_RM in the raw state
    deviations     (n, contributor), in mm or the units of the contributor
    moments        (n, side, moment) of the points that count in the objective
    may_carry      for each pair of the group (n, point), or None if every point may
    scans          for each pair of the group the points that may be active
    """

    raw: Float[Array, "n part 12"]
    relative: Float[Array, "n pair 12"]
    deviations: Float[Array, "n contributor"]
    moments: Float[Array, "n side moment"]
    may_carry: list[Bool[Array, "n _"] | None]
    scans: Sequence[Scan]

    def __len__(self) -> int:
        return len(self.raw)

    def take(self, rows: np.ndarray) -> "Task":
        """Return the task of some realizations."""
        arrays = {name: getattr(self, name)[rows] for name in ("raw", "relative", "deviations", "moments")}
        may_carry = [None if mask is None else mask[rows] for mask in self.may_carry]
        return Task(**arrays, may_carry=may_carry, scans=[scan.take(rows) for scan in self.scans])


@dataclass(frozen=True, eq=False, kw_only=True)
class State(Record):
    """The progress of the steps of a task, with the numbers of its record. Steps write into the arrays.

    poses       (n, part of the group, 12)
    relative    (n, pair of the group, 12): X_RM
    slack       (n, pair of the group) [mm]: penetration that no increment could remove
    astray      (n,) [mm]: distance of two-sided locators from the positions where they should hold
    multipliers (n, row of the QP): reactions, negative if a two-sided locator pulls at an elastic part
    gap_min     (n, pair of the group) [mm]: smallest true gap at `poses`, once they are an answer
    doubtful    (n,): whether the answer is further from the raw pose than the method accepts
    slots       of the pairs with changing points: the points that were active last
    """

    poses: Float[Array, "n part 12"]
    relative: Float[Array, "n pair 12"]
    slack: Float[Array, "n pair"]
    astray: Float[Array, " n"]
    multipliers: Float[Array, "n row"]
    gap_min: Float[Array, "n pair"]
    doubtful: Bool[Array, " n"]
    slots: list[Slots]

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def in_conflict(self) -> Bool[Array, " n"]:
        """(n,): whether penetration was left that no increment could remove."""
        return np.any(self.slack > ACCURACY, axis=1)

    @property
    def solved(self) -> Bool[Array, " n"]:
        """(n,): whether the optimality conditions hold. A conflict is accepted if it exceeds what was left undone."""
        return np.asarray(self.kkt_residual <= np.maximum(ACCURACY, self.slack.max(axis=1)))

    @property
    def outcome(self) -> Int[Array, " n"]:
        """(n,): the Outcome."""
        solved = np.where(self.in_conflict, Outcome.IN_CONFLICT, Outcome.RESOLVED)
        return np.where(self.solved, np.where(self.doubtful, Outcome.DOUBTFUL, solved), Outcome.UNSOLVED)

    @property
    def certified(self) -> Bool[Array, " n"]:
        """(n,): whether the answer is certified."""
        return self.outcome == Outcome.RESOLVED

    @property
    def loaded(self) -> Bool[Array, "n row"]:
        """(n, row of the QP): whether its point is under load."""
        sizes = np.abs(self.multipliers)
        return np.asarray(sizes > LOADED_SHARE * sizes.max(axis=1, initial=0)[:, None])

    @classmethod
    def start(
        cls, poses: Float[Array, "n part 12"], relative: Float[Array, "n pair 12"], rows: int, slots: Sequence[int]
    ) -> "State":
        """Return the state before the first step of a QP with `rows` rows; pairs with changing points have `slots` slots."""
        count, pairs = relative.shape[:2]
        return cls(
            **initial_numbers(count),
            poses=poses.copy(),
            relative=relative.copy(),
            slack=np.zeros((count, pairs)),
            astray=np.zeros(count),
            multipliers=np.zeros((count, rows)),
            gap_min=np.full((count, pairs), np.nan),
            doubtful=np.zeros(count, dtype=bool),
            slots=[Slots.empty(count, number) for number in slots],
        )

    def take(self, rows: np.ndarray) -> "State":
        """Return a copy of some realizations."""
        return type(self)(
            **{name: getattr(self, name)[rows] for name in _ARRAYS}, slots=[slots.take(rows) for slots in self.slots]
        )

    def put(self, rows: np.ndarray, state: "State") -> None:
        """Replace some realizations."""
        for name in _ARRAYS:
            getattr(self, name)[rows] = getattr(state, name)
        for slots, replacement in zip(self.slots, state.slots, strict=True):
            slots.put(rows, replacement)

    def put_answer(self, rows: np.ndarray, state: "State") -> None:
        """Replace the poses of some realizations, and what belongs to them, but not the record of how they were reached."""
        for name in ANSWER:
            getattr(self, name)[rows] = getattr(state, name)


_ARRAYS = tuple(entry.name for entry in fields(State) if entry.name != "slots")


class Unsettled:
    """Realizations that still move, with their own task and state; settled ones are written back to the original state."""

    def __init__(self, task: Task, state: State) -> None:
        self._whole, self._rows = state, np.arange(len(task))
        self.task, self.state = task, state

    def __len__(self) -> int:
        return len(self._rows)

    def settle(self, done: Bool[Array, " n"]) -> None:
        """Put back the realizations that are `done` (n,), and keep the others."""
        if not done.any():
            return
        if self.state is not self._whole:
            self._whole.put(self._rows[done], self.state.take(done))
        moves = ~done
        self._rows, self.task, self.state = self._rows[moves], self.task.take(moves), self.state.take(moves)


@dataclass(frozen=True, eq=False)
class Resolved:
    """The outcome of one group for the realizations `touched` of a block.

    touched   (n,): their indices in the block
    state     their State in the end

    and of all realizations of the block:

    gap_min   (realization, state, pair of the group) [mm]: smallest true gap
    active    (realization, pair of the group): number of active contact points in the raw state
    """

    touched: Int[Array, " n"]
    state: State
    gap_min: Float[Array, "realization state pair"]
    active: Int[Array, "realization pair"]

    def reactions(self, spans: Sequence[slice], pairs: Sequence[ContactPoints]) -> Float[Array, "n pair"]:
        """Return the sum of the reactions of each pair, (n, pair), whose rows of the QP are `spans`; pulls are negative."""
        sums = []
        for span, pair in zip(spans, pairs, strict=True):
            reactions = self.state.multipliers[:, span]
            sums.append((reactions if pair.pulls is None else np.where(pair.pulls, -reactions, reactions)).sum(axis=1))
        return np.stack(sums, axis=1)

    def carrying(self, spans: Sequence[slice]) -> Int[Array, "n pair"]:
        """Return the number of points under load of each pair, (n, pair)."""
        loaded = self.state.loaded
        return np.stack([loaded[:, span].sum(axis=1) for span in spans], axis=1)
