"""Places at which two bodies can touch, at some poses."""

from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int


class Places(NamedTuple):
    """Points at which two bodies can touch, at n poses.

    labels    (n, point): indices of the points among all candidates, -1 for none
    gaps      (n, point) [mm], infinite for none
    P_m, P_r, n_r   (n, point, 3): the points on both bodies, and the normal, in the frames of the paper
    """

    labels: Int[Array, "n p"]
    gaps: Float[Array, "n p"]
    P_m: Float[Array, "n p 3"]
    P_r: Float[Array, "n p 3"]
    n_r: Float[Array, "n p 3"]


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


class RaisedPlaces(NamedTuple):
    """Points of nominal faces, and the heights (n, place) [mm] of both faces there, which reduce the gaps."""

    places: Places
    heights: Float[Array, "n p"]

    @property
    def gaps(self) -> Float[Array, "n p"]:
        """The gaps (n, place) [mm] of the actual faces, infinite where there is no candidate."""
        return np.asarray(self.places.gaps - self.heights)

    def only(self, counts: Bool[Array, "n p"]) -> "RaisedPlaces":
        """Return the same points, of which only some count."""
        return self._replace(places=self.places._replace(gaps=np.where(counts, self.places.gaps, np.inf)))

    def followed_by(self, *others: "RaisedPlaces") -> "RaisedPlaces":
        """Return these points, and after them others at the same poses."""
        every = (self, *others)
        joined = (np.concatenate(arrays, axis=1) for arrays in zip(*(raised.places for raised in every), strict=True))
        return RaisedPlaces(Places(*joined), np.concatenate([raised.heights for raised in every], axis=1))


def unraised(places: Places) -> RaisedPlaces:
    """Return points without heights."""
    return RaisedPlaces(places, np.zeros(places.gaps.shape))
