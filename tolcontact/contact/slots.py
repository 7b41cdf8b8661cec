"""Slots of the contact QP: the points of a pair that have a row in it, realization by realization."""

from dataclasses import dataclass

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int

MAX_CARRYING = 8  # points that keep their slots from one round to the next
NEGLIGIBLE_SHARE = 1e-9  # of the largest multiplier of a pair: smaller ones are rounding


@dataclass(frozen=True, eq=False)
class Slots:
    """points (n, slot): numbers of contact points; filled (n, slot): which slots are in use; reactions (n, slot)."""

    points: Int[Array, "n slot"]
    filled: Bool[Array, "n slot"]
    reactions: Float[Array, "n slot"]

    @classmethod
    def empty(cls, count: int, slots: int) -> "Slots":
        """Return slots that hold no point."""
        return cls(np.zeros((count, slots), dtype=int), np.zeros((count, slots), dtype=bool), np.zeros((count, slots)))

    def copy(self) -> "Slots":
        """Return a copy, which stays while these slots change."""
        return Slots(self.points.copy(), self.filled.copy(), self.reactions.copy())

    def take(self, rows: np.ndarray) -> "Slots":
        """Return the slots of some realizations."""
        return Slots(self.points[rows], self.filled[rows], self.reactions[rows])

    def put(self, rows: np.ndarray, slots: "Slots") -> None:
        """Replace the slots of some realizations."""
        self.points[rows], self.filled[rows], self.reactions[rows] = slots.points, slots.filled, slots.reactions

    def reactions_of(self, points: Int[Array, "n slot"]) -> Float[Array, "n slot"]:
        """Return the reactions of some contact points (n, slot), 0 for points that have no slot."""
        matches = (points[:, :, None] == self.points[:, None, :]) & self.filled[:, None, :]
        return np.where(matches, self.reactions[:, None, :], 0.0).max(axis=2)

    def carrying(self, multipliers: Float[Array, "n slot"]) -> "Slots":
        """Return only the slots whose rows carry, at most MAX_CARRYING, those of the largest multipliers (n, slot) first."""
        largest = np.where(self.filled, multipliers, 0.0)
        order = np.argsort(-largest, axis=1, kind="stable")
        sorted_ = np.take_along_axis(largest, order, axis=1)
        carries = sorted_ > NEGLIGIBLE_SHARE * np.maximum(sorted_[:, :1], NEGLIGIBLE_SHARE)
        carries[:, MAX_CARRYING:] = False
        return Slots(np.take_along_axis(self.points, order, axis=1), carries, np.where(carries, sorted_, 0.0))

    def with_deepest(
        self, points: Int[Array, "n cluster"], depth: Float[Array, "n cluster"], tolerance: float
    ) -> tuple["Slots", Bool[Array, " n"]]:
        """Return slots whose free places hold the deepest of the candidate `points` (n, cluster) that are inside.

        Returns also whether any candidate is new, (n,).
        """
        has_slot = ((points[:, :, None] == self.points[:, None, :]) & self.filled[:, None, :]).any(axis=2)
        new = (depth > tolerance) & ~has_slot
        urgency = np.hstack([np.where(self.filled, np.inf, -np.inf), np.where(new, depth, -np.inf)])
        order = np.argsort(-urgency, axis=1, kind="stable")[:, : self.points.shape[1]]
        candidates = np.hstack([self.points, points])
        reactions = np.hstack([self.reactions, np.zeros(points.shape)])
        filled = np.take_along_axis(urgency, order, axis=1) > -np.inf
        slots = Slots(np.take_along_axis(candidates, order, axis=1), filled, np.take_along_axis(reactions, order, axis=1))
        return slots, new.any(axis=1)
