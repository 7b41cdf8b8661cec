"""A scan of the places where two bodies can touch, found at given poses."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import MANY_SLOTS
from tolcontact.contact import bounded_kernel
from tolcontact.contact.scan import Deepest, Scan
from tolcontact.discretization import FIRST_POINT
from tolcontact.geometry.kernel import CORNER_ON_FACET
from tolcontact.geometry.meeting import Meeting
from tolcontact.geometry.minima_kernel import FIRST_PLACE
from tolcontact.geometry.places import RaisedPlaces

MAX_DEEPEST = MANY_SLOTS  # places of a pair that get a row in one round
MIN_HEIGHTS = 4  # that vary independently: fewer are as fast in every pass


class SearchedPlaces(NamedTuple):
    """Places where a pair can touch, found at given poses, separately for each realization.

    labels          (realization, place): -1 for none
    P_m, P_r, n_r   (realization, place, 3): P^m, P^r, n^r of nominal faces
    heights         (realization, place) [mm]: growth of both faces there, including form deviations
    valid           (realization, place): the places that count
    """

    labels: Int[Array, "realization place"]
    P_m: Float[Array, "realization place 3"]
    P_r: Float[Array, "realization place 3"]
    n_r: Float[Array, "realization place 3"]
    heights: Float[Array, "realization place"]
    valid: Bool[Array, "realization place"]

    @classmethod
    def none(cls, count: int, room: int = 0) -> "SearchedPlaces":
        """Return empty places for a number of realizations, with room for some."""
        shape = count, room
        P_m, P_r, n_r = np.zeros((3, *shape, 3))
        return cls(np.full(shape, -1), P_m, P_r, n_r, np.zeros(shape), np.zeros(shape, dtype=bool))

    @classmethod
    def of(cls, raised: RaisedPlaces) -> "SearchedPlaces":
        """Return places at the poses where they were found."""
        places, heights = raised.places, np.ascontiguousarray(raised.heights)
        return cls(places.labels, places.P_m, places.P_r, np.ascontiguousarray(places.n_r), heights, np.isfinite(places.gaps))

    def take(self, rows: np.ndarray) -> "SearchedPlaces":
        """Return the places of some realizations."""
        return SearchedPlaces(*(values[rows] for values in self))

    def gaps(self, relative: Float[Array, "realization 12"]) -> Float[Array, "realization place"]:
        """Return the gaps [mm] at X_RM; infinite where there is no place."""
        gaps = np.empty(self.labels.shape)
        bounded_kernel.gaps(np.ascontiguousarray(relative), *self[1:], gaps)
        return gaps

    def deepest(self, relative: Float[Array, "realization 12"], count: int, distance: float) -> Deepest:
        """Return the deepest places at X_RM, at most `count`, see bounded_kernel.deepest."""
        found = Deepest(np.empty((len(relative), count), dtype=np.int64), np.empty((len(relative), count)))
        bounded_kernel.deepest(np.ascontiguousarray(relative), *self, distance, *found)
        return found

    def rows(self, labels: Int[Array, "realization slot"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return P^m, P^r, n^r (realization, slot, 3) of the places with some labels, on deviating faces."""
        P_m, P_r, n_r = np.empty((3, *labels.shape, 3))
        bounded_kernel.gather(labels, self.labels, self.P_m, self.P_r, self.n_r, self.heights, P_m, P_r, n_r)
        return P_m, P_r, n_r

    def holds(self, labels: Int[Array, "realization slot"]) -> Bool[Array, "realization slot"]:
        """Return whether places with some labels are among those that count."""
        found = np.empty(labels.shape, dtype=bool)
        bounded_kernel.contains(labels, self.labels, self.valid, found)
        return found


@dataclass(frozen=True, eq=False)
class BoundedScan(Scan):
    """Places where a pair can touch at given poses: for each realization, the places with the smallest gaps.

    places   whose labels are their indices in the meeting of the pair
    """

    fills = True

    meeting: Meeting
    places: SearchedPlaces

    def take(self, rows: np.ndarray) -> "BoundedScan":
        return BoundedScan(self.meeting, self.places.take(rows))

    @property
    def minima(self) -> Int[Array, "realization minimum"]:
        """The labels of minima of the gap between contact points, -1 for none."""
        labels = self.places.labels
        is_minimum = labels >= FIRST_PLACE
        return np.where(is_minimum, labels, -1)[:, is_minimum.any(axis=0)]

    def min_gap(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        gaps = np.where(self.places.labels < FIRST_PLACE, self.places.gaps(relative), np.inf)
        return gaps.min(axis=1, initial=np.inf)

    def depth_between(self, relative: np.ndarray) -> np.ndarray:
        gaps = np.where(self.places.labels < FIRST_PLACE, np.inf, self.places.gaps(relative))
        return -gaps.min(axis=1, initial=0.0)

    def deepest(self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None) -> Deepest:
        return self.places.deepest(relative, min(MAX_DEEPEST, self.places.labels.shape[1]), self.meeting.reach.spread)

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.places.rows(points)

    def holds(self, points: np.ndarray) -> np.ndarray:
        return self.places.holds(points)

    def moves(self, points: np.ndarray) -> np.ndarray:
        if not len(self.meeting.kinds):
            return np.zeros(points.shape, dtype=bool)
        at_ends = np.where(points < FIRST_POINT, points, 0)
        return (self.meeting.kinds[at_ends] == CORNER_ON_FACET) & (points < FIRST_POINT)
