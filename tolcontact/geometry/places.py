"""Places at which two bodies can touch, at some poses."""

from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.geometry import bounded_kernel


class Places(NamedTuple):
    """Points at which two bodies can touch, found at n poses.

    labels    (n, place): indices of the points among all candidates, -1 for none
    gaps      (n, place) [mm] of nominal faces at these poses, infinite for none
    P_m, P_r, n_r   (n, place, 3): the points on both nominal bodies, and the normal, in the frames of the paper
    heights   (n, place) [mm] of both faces there, including form deviations, which reduce the gaps
    """

    labels: Int[Array, "n place"]
    gaps: Float[Array, "n place"]
    P_m: Float[Array, "n place 3"]
    P_r: Float[Array, "n place 3"]
    n_r: Float[Array, "n place 3"]
    heights: Float[Array, "n place"]

    @classmethod
    def none(cls, count: int, room: int = 0) -> "Places":
        """Return empty places at a number of poses, with room for some."""
        shape = count, room
        P_m, P_r, n_r = np.zeros((3, *shape, 3))
        return cls(np.full(shape, -1), np.full(shape, np.inf), P_m, P_r, n_r, np.zeros(shape))

    @property
    def actual_gaps(self) -> Float[Array, "n place"]:
        """The gaps (n, place) [mm] of the actual faces, infinite where there is no candidate."""
        return np.asarray(self.gaps - self.heights)

    def take(self, rows: np.ndarray) -> "Places":
        """Return the places at some of the poses."""
        return Places(*(values[rows] for values in self))

    def among(self, count: int, rows: np.ndarray) -> "Places":
        """Return these places at some `rows` of a number of poses, and none at the others."""
        every = Places.none(count, self.labels.shape[1])
        for values, of_rows in zip(every, self, strict=True):
            values[rows] = of_rows
        return every

    def only(self, counts: Bool[Array, "n place"]) -> "Places":
        """Return the same points, of which only some count."""
        return self._replace(gaps=np.where(counts, self.gaps, np.inf))

    def followed_by(self, *others: "Places") -> "Places":
        """Return these points, and after them others at the same poses."""
        return Places(*(np.concatenate(arrays, axis=1) for arrays in zip(self, *others, strict=True)))

    def gaps_at(self, X_RM: Float[Array, "n 12"]) -> Float[Array, "n place"]:
        """Return the gaps [mm] of the actual faces at other poses; infinite where there is no place."""
        gaps = np.empty(self.labels.shape)
        bounded_kernel.gaps(np.ascontiguousarray(X_RM), *self[2:], np.isfinite(self.gaps), gaps)
        return gaps

    def deepest(
        self, X_RM: Float[Array, "n 12"], count: int, distance: float
    ) -> tuple[Int[Array, "n deepest"], Float[Array, "n deepest"]]:
        """Return the labels and depths of the deepest places at X_RM, at most `count`, see bounded_kernel.deepest."""
        labels, depths = np.empty((len(X_RM), count), dtype=np.int64), np.empty((len(X_RM), count))
        poses, is_place = np.ascontiguousarray(X_RM), np.isfinite(self.gaps)
        bounded_kernel.deepest(poses, self.labels, *self[2:], is_place, distance, labels, depths)
        return labels, depths

    def rows(self, labels: Int[Array, "n slot"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return P^m, P^r, n^r (n, slot, 3) of the places with some labels, on actual faces."""
        P_m, P_r, n_r = np.empty((3, *labels.shape, 3))
        bounded_kernel.gather(labels, self.labels, *self[2:], P_m, P_r, n_r)
        return P_m, P_r, n_r

    def holds(self, labels: Int[Array, "n slot"]) -> Bool[Array, "n slot"]:
        """Return whether places with some labels are among those that count."""
        found = np.empty(labels.shape, dtype=bool)
        bounded_kernel.contains(labels, self.labels, np.isfinite(self.gaps), found)
        return found


class Look(NamedTuple):
    """How places are looked for at n poses.

    retained   (n, k): indices of candidates that are included, -1 for none
    error      [mm]: facing planes count up to this error beyond their edges. Steps need this: otherwise a corner that overhangs
               an edge becomes active and inactive in turn
    nearness   in margins outside edges: largest distance of such a place from a point where the planes touch
    ceilings   (n,) [mm]: places of facing planes with larger gaps may be missing if there are places with smaller gaps
    """

    retained: Int[Array, "n k"] | None = None
    error: float = 0.0
    nearness: float = 2.0
    ceilings: Float[Array, " n"] | None = None

    def take(self, rows: Int[Array, " m"], first: int) -> "Look":
        """Return how the places of some rows are looked for, where indices start from a `first` candidate."""
        retained = None if self.retained is None else np.maximum(self.retained[rows] - first, -1)
        return self._replace(retained=retained, ceilings=None if self.ceilings is None else self.ceilings[rows])


PLAIN = Look()
