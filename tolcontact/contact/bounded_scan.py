"""A scan of the places where two bodies can touch, found at given poses."""

from dataclasses import dataclass

import numpy as np

from tolcontact.arrays import Array, Int
from tolcontact.compilation import MANY_SLOTS
from tolcontact.contact.scan import Deepest, Scan
from tolcontact.discretization import FIRST_POINT
from tolcontact.geometry.kernel import CORNER_ON_FACET
from tolcontact.geometry.meeting import Meeting
from tolcontact.geometry.minima_kernel import FIRST_PLACE
from tolcontact.geometry.places import Places

MAX_DEEPEST = MANY_SLOTS  # places of a pair that get a row in one round


@dataclass(frozen=True, eq=False)
class BoundedScan(Scan):
    """Places where a pair can touch at given poses: for each realization, the places with the smallest gaps.

    places   whose labels are their indices in the meeting of the pair
    """

    fills = True

    meeting: Meeting
    places: Places

    def take(self, rows: np.ndarray) -> "BoundedScan":
        return BoundedScan(self.meeting, self.places.take(rows))

    @property
    def minima(self) -> Int[Array, "realization minimum"]:
        """The labels of minima of the gap between contact points, -1 for none."""
        labels = self.places.labels
        is_minimum = labels >= FIRST_PLACE
        return np.where(is_minimum, labels, -1)[:, is_minimum.any(axis=0)]

    def min_gap(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        gaps = np.where(self.places.labels < FIRST_PLACE, self.places.gaps_at(relative), np.inf)
        return gaps.min(axis=1, initial=np.inf)

    def depth_between(self, relative: np.ndarray) -> np.ndarray:
        gaps = np.where(self.places.labels < FIRST_PLACE, np.inf, self.places.gaps_at(relative))
        return -gaps.min(axis=1, initial=0.0)

    def deepest(self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None) -> Deepest:
        count = min(MAX_DEEPEST, self.places.labels.shape[1])
        return Deepest(*self.places.deepest(relative, count, self.meeting.reach.spread))

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.places.rows(points)

    def holds(self, points: np.ndarray) -> np.ndarray:
        return self.places.holds(points)

    def moves(self, points: np.ndarray) -> np.ndarray:
        if not len(self.meeting.kinds):
            return np.zeros(points.shape, dtype=bool)
        at_ends = np.where(points < FIRST_POINT, points, 0)
        return (self.meeting.kinds[at_ends] == CORNER_ON_FACET) & (points < FIRST_POINT)
