"""Slots of the contact QP: which points of a pair have a row in it, realization by realization."""

from dataclasses import dataclass

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int

MOST = 8  # points that keep their slots from one round to the next
NOTHING = 1e-9  # of the largest multiplier of a pair: smaller ones are rounding


@dataclass(frozen=True, eq=False)
class Slots:
    """points (n, slot): numbers of contact points; filled (n, slot): which slots are in use; reactions (n, slot)."""

    points: Int[Array, "n slot"]
    filled: Bool[Array, "n slot"]
    reactions: Float[Array, "n slot"]

    @classmethod
    def empty(cls, count: int, slots: int) -> "Slots":
        """No point has a slot."""
        return cls(np.zeros((count, slots), dtype=int), np.zeros((count, slots), dtype=bool), np.zeros((count, slots)))

    def copy(self) -> "Slots":
        """The same, to be kept while these change."""
        return Slots(self.points.copy(), self.filled.copy(), self.reactions.copy())

    def take(self, some: np.ndarray) -> "Slots":
        """The slots of some realizations."""
        return Slots(self.points[some], self.filled[some], self.reactions[some])

    def put(self, some: np.ndarray, other: "Slots") -> None:
        """Replace the slots of some realizations."""
        self.points[some], self.filled[some], self.reactions[some] = other.points, other.filled, other.reactions

    def reactions_of(self, points: Int[Array, "n slot"]) -> Float[Array, "n slot"]:
        """The reactions of some contact points (n, slot), 0 if they have none here."""
        same = (points[:, :, None] == self.points[:, None, :]) & self.filled[:, None, :]
        return np.asarray(np.where(same, self.reactions[:, None, :], 0.0).max(axis=2))

    def kept(self, multipliers: Float[Array, "n slot"]) -> "Slots":
        """Only the slots whose rows carry, at most MOST of them, largest multipliers (n, slot) first."""
        largest = np.where(self.filled, multipliers, 0.0)
        order = np.argsort(-largest, axis=1, kind="stable")
        sorted_ = np.take_along_axis(largest, order, axis=1)
        carries = sorted_ > NOTHING * np.maximum(sorted_[:, :1], NOTHING)
        carries[:, MOST:] = False
        return Slots(np.take_along_axis(self.points, order, axis=1), carries, np.where(carries, sorted_, 0.0))

    def with_deepest(
        self, points: Int[Array, "n cluster"], depth: Float[Array, "n cluster"], tolerance: float
    ) -> tuple["Slots", Bool[Array, " n"]]:
        """Fill the free slots with the deepest of the candidate `points` (n, cluster) that are inside.

        Returns the new slots, and (n,) whether any candidate was new.
        """
        known = ((points[:, :, None] == self.points[:, None, :]) & self.filled[:, None, :]).any(axis=2)
        new = (depth > tolerance) & ~known
        urgency = np.hstack([np.where(self.filled, np.inf, -np.inf), np.where(new, depth, -np.inf)])
        order = np.argsort(-urgency, axis=1, kind="stable")[:, : self.points.shape[1]]
        every = np.hstack([self.points, points])
        reactions = np.hstack([self.reactions, np.zeros(points.shape)])
        filled = np.take_along_axis(urgency, order, axis=1) > -np.inf
        chosen = (np.take_along_axis(values, order, axis=1) for values in (every, reactions))
        return Slots(next(chosen), filled, next(chosen)), new.any(axis=1)
