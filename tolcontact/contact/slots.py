"""The slots of a pair in the QP: rows that points take in turns."""

from dataclasses import dataclass

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.contact import slots_kernel

MAX_CARRYING = 8  # points that keep their slots from one round to the next
NEGLIGIBLE_SHARE = 1e-9  # of the largest multiplier of a pair: smaller ones are rounding


@dataclass(frozen=True, eq=False)
class Slots:
    """points (n, slot): indices of contact points; filled (n, slot): which slots are in use; reactions (n, slot)."""

    points: Int[Array, "n slot"]
    filled: Bool[Array, "n slot"]
    reactions: Float[Array, "n slot"]

    @classmethod
    def empty(cls, count: int, slots: int) -> "Slots":
        """Return slots that hold no point."""
        return cls(np.zeros((count, slots), dtype=int), np.zeros((count, slots), dtype=bool), np.zeros((count, slots)))

    @property
    def labels(self) -> Int[Array, "n slot"]:
        """The indices of the points, -1 in empty slots."""
        return np.where(self.filled, self.points, -1)

    def only(self, present: Bool[Array, "n slot"]) -> "Slots":
        """Return a copy, which stays while these slots change, of the slots whose points are still `present` (n, slot)."""
        return Slots(self.points.copy(), self.filled & present, self.reactions.copy())

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
        """Return only the slots of active rows, at most MAX_CARRYING, the largest multipliers (n, slot) first."""
        kept = np.empty_like(self.points), np.empty_like(self.filled), np.empty_like(self.reactions)
        slots_kernel.keep(self.points, self.filled, multipliers, NEGLIGIBLE_SHARE, MAX_CARRYING, kept)
        return Slots(*kept)

    def with_deepest(
        self, points: Int[Array, "n cluster"], depth: Float[Array, "n cluster"], tolerance: float, *, fills: bool
    ) -> tuple["Slots", Bool[Array, " n"]]:
        """Return slots whose free places hold the deepest of the candidate `points` (n, cluster) that are inside.

        Returns also whether any candidate that is inside is new, (n,). If it `fills`, candidates outside follow those inside;
        a depth of -inf means no candidate.
        """
        extended = np.empty_like(self.points), np.empty_like(self.filled), np.empty_like(self.reactions)
        grows = np.empty(len(points), dtype=bool)
        slots_kernel.extend(self.points, self.filled, self.reactions, points, depth, tolerance, fills, (*extended, grows))
        return Slots(*extended), grows
