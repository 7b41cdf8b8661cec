"""Scans of places that are searched at every pose: of bounded bodies, and of faces with form.

Heights of faces with form are summed up once for each realization, not in every pass. The smallest gap of a leaf follows from
the gaps of its nominal points and its largest height. Planes also touch at local minima of the gap between their points, which
are searched from the deepest point of each leaf.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import MANY_SLOTS
from tolcontact.contact import bounded_kernel, kernel
from tolcontact.contact.scan import Deepest, FixedScan, Scan
from tolcontact.discretization import FIRST_POINT, ContactPoints
from tolcontact.discretization.plane_minima import with_former
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


@dataclass(frozen=True, eq=False)
class RaisedScan(FixedScan):
    """The points of some of the realizations of a block, with known heights, and `minima` of the gap between the points.

    The lowest points of clusters take the remaining slots, too: faces with form end up on a few points anywhere, and fewer QPs
    find these points if all sides of the faces have rows from the first QP on.
    """

    fills = True

    minima: SearchedPlaces = field(kw_only=True)

    def take(self, rows: np.ndarray) -> "RaisedScan":
        return replace(self, raised=self.raised._replace(rows=self.raised.rows[rows]), minima=self.minima.take(rows))

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        is_point, realization = points < FIRST_PLACE, self.raised.rows[:, None]
        numbers = np.where(is_point, points, 0)
        P_m, P_r, n_r = (x[numbers] for x in (self.pair.P_m, self.pair.P_r, self.pair.n_r))
        P_r = P_r - self.raised.points[realization, numbers][..., None] * n_r
        if not is_point.all():
            both = zip((P_m, P_r, n_r), self.minima.rows(points), strict=True)
            P_m, P_r, n_r = (np.where(is_point[..., None], *vectors) for vectors in both)
        return P_m, P_r, n_r

    def holds(self, points: np.ndarray) -> np.ndarray:
        return self.minima.holds(points) | (points < FIRST_PLACE)

    def deepest(self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None) -> Deepest:
        points, gaps = self.deepest_of(self.clusters, relative, deviations, may_carry)
        if self.minima.labels.shape[1]:
            points = np.concatenate([points, np.maximum(self.minima.labels, 0)], axis=1)
            gaps = np.concatenate([gaps, self.minima.gaps(relative)], axis=1)
        return Deepest(points, -gaps)

    def depth_between(self, relative: np.ndarray) -> np.ndarray:
        return -self.minima.gaps(relative).min(axis=1, initial=0.0)

    def with_minima(
        self,
        pair: ContactPoints,
        relative: Float[Array, "realization 12"],
        deviations: Float[Array, "realization contributor"],
        depth: float,
        *,
        is_raw: bool = False,
        in_steps: bool = False,
    ) -> "RaisedScan":
        """Return the scan with the minima of the gap at X_RM that are deeper than `depth` [mm], and those found before.

        In the raw state (`is_raw`) there are none where a point is inside: contact moves these realizations anyway.
        """
        assert pair.minima is not None
        if is_raw:
            rows = np.flatnonzero(self.min_gap(relative, deviations) >= 0)
            if not rows.size:
                return self
            found = self.take(rows).with_minima(pair, relative[rows], deviations[rows], depth).minima
            every = SearchedPlaces.none(len(relative), found.labels.shape[1])
            for values, of_clear in zip(every, found, strict=True):
                values[rows] = of_clear
            return replace(self, minima=every)
        grown, limits = pair.heights(deviations), pair.minima.bulge(deviations)
        gaps, P_m = self.gaps(relative, deviations, limits), self.pair.P_m[None]
        labels = pair.minima.find(relative, deviations, grown, P_m, gaps, limits, depth, in_steps=in_steps)
        labels = with_former(labels, self.minima.labels)
        if not labels.shape[1]:
            return replace(self, minima=SearchedPlaces.none(len(relative)))
        places, heights = pair.minima.at(relative, deviations, labels)
        return replace(self, minima=SearchedPlaces.of(RaisedPlaces(places, heights + grown[:, None])))


def raised_scan(scan: FixedScan, deviations: Float[Array, "realization contributor"], *, always: bool = False) -> Scan:
    """Return the scan of realizations with deviations; without many heights the same one, unless `always`."""
    of, count = scan.points, len(deviations)
    if len(of.columns) < MIN_HEIGHTS and not always:
        return scan
    sizes = of.coordinates.shape[1], len(of.leaves) - 1, len(of.branches) - 1
    points, leaves, branches = (np.empty((count, size)) for size in sizes)
    raised = kernel.Raised(points, leaves, branches, np.arange(count))
    slopes, heights = of.coordinates[of.basis.shape[1] :], np.ascontiguousarray(deviations)
    kernel.sum_heights(of.columns, slopes, of.leaves, of.branches, heights, raised)
    return RaisedScan(scan.pair, scan.nominal_points, scan.clusters, (), raised, minima=SearchedPlaces.none(count))
