"""A scan of faces with form: heights of all points are summed up once for each realization, not in every pass.

The smallest gap of a leaf follows from the gaps of its nominal points and its largest height. Planes also touch at local minima
of the gap between their points, which are searched from the deepest point of each leaf.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.contact import bounded_kernel, kernel, raised_kernel
from tolcontact.contact.scan import CompiledScan, Deepest, PairScan
from tolcontact.discretization import ContactPoints
from tolcontact.discretization.plane_minima import with_former
from tolcontact.geometry.minima_kernel import FIRST_PLACE

MIN_HEIGHTS = 4  # that vary independently: fewer are as fast in every pass


class GapMinima(NamedTuple):
    """Local minima of the gap between contact points, separately for each realization: see PlaneMinima.

    labels             (realization, place), -1 for none
    P_m, feet, n_r     (realization, place, 3): P^m, P^r, n^r of nominal faces
    heights            (realization, place) [mm]: growth of both faces there, including form deviations
    """

    labels: Int[Array, "realization place"]
    P_m: Float[Array, "realization place 3"]
    feet: Float[Array, "realization place 3"]
    n_r: Float[Array, "realization place 3"]
    heights: Float[Array, "realization place"]

    @classmethod
    def none(cls, count: int, room: int = 0) -> "GapMinima":
        """Return empty minima for a number of realizations, with room for some."""
        P_m, feet, n_r = np.zeros((3, count, room, 3))
        return cls(np.full((count, room), -1), P_m, feet, n_r, np.zeros((count, room)))

    def gaps(self, relative: Float[Array, "realization 12"]) -> Float[Array, "realization place"]:
        """Return the gaps [mm] at X_RM; infinite where there is no place."""
        gaps = np.where(self.labels >= 0, 0.0, np.inf)
        bounded_kernel.gaps(np.ascontiguousarray(relative), self.P_m, self.feet, self.n_r, self.heights, gaps)
        return gaps


@dataclass(frozen=True, eq=False)
class RaisedScan(CompiledScan):
    """A scan of some of the realizations of a block.

    nominal          P_m, P_r, n_r (point, 3) of nominal faces
    compiled_points  of these
    raised           (realization of the block, point) [mm]: added to the gaps of nominal faces, below 0 where faces are raised
    lowest           (realization of the block, leaf) [mm]: the least of these
    numbers          (realization,): indices of the realizations in the block
    minima           of the gap between the points

    The lowest points of clusters take the remaining slots, too: faces with form end up on a few points anywhere, and fewer QPs
    find these points if all sides of the faces have rows from the first QP on.
    """

    fills = True

    nominal: tuple[np.ndarray, np.ndarray, np.ndarray]
    compiled_points: kernel.Points
    raised: Float[Array, "m point"]
    lowest: Float[Array, "m leaf"]
    numbers: Int[Array, " realization"]
    minima: GapMinima

    def take(self, rows: np.ndarray) -> "RaisedScan":
        return replace(self, numbers=self.numbers[rows], minima=GapMinima(*(values[rows] for values in self.minima)))

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        P_m, P_r, n_r = vectors = [np.empty((*points.shape, 3)) for _ in range(3)]
        is_point = points < FIRST_PLACE
        raised_kernel.gather(*self.nominal, self.raised, self.numbers, np.where(is_point, points, 0), *vectors)
        if not is_point.all():
            minima = self.minima
            places = [np.empty((*points.shape, 3)) for _ in range(3)]
            bounded_kernel.gather(points, minima.labels, minima.P_m, minima.feet, minima.n_r, minima.heights, *places)
            P_m, P_r, n_r = (np.where(is_point[..., None], *both) for both in zip(vectors, places, strict=True))
        return P_m, P_r, n_r

    def holds(self, points: np.ndarray) -> np.ndarray:
        is_held = np.empty(points.shape, dtype=bool)
        bounded_kernel.contains(points, self.minima.labels, self.minima.labels >= 0, is_held)
        return is_held | (points < FIRST_PLACE)

    def deepest(self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None) -> Deepest:
        points, gaps = self._deepest(self.clusters, relative, deviations, may_carry, np.inf)
        if self.minima.labels.shape[1]:
            points = np.concatenate([points, np.maximum(self.minima.labels, 0)], axis=1)
            gaps = np.concatenate([gaps, self.minima.gaps(relative)], axis=1)
        return Deepest(points, -gaps)

    def _deepest(
        self, clusters: np.ndarray, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None, limit: float
    ) -> tuple[np.ndarray, np.ndarray]:
        points = np.empty((len(relative), len(clusters) - 1), dtype=np.int64)
        gaps = np.empty(points.shape)
        mask = np.empty((len(relative), 0), dtype=bool) if may_carry is None else np.ascontiguousarray(may_carry)
        poses, leaves = np.ascontiguousarray(relative), self.branches[clusters]
        block = self.raised, self.lowest, self.numbers
        raised_kernel.deepest(self.compiled_points, leaves, poses, *block, mask, limit, points, gaps)
        return points, gaps

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
            is_clear = self.min_gap(relative, deviations) >= 0
            if not is_clear.any():
                return self
            rows = np.flatnonzero(is_clear)
            found = self.take(rows).with_minima(pair, relative[rows], deviations[rows], depth).minima
            every = GapMinima.none(len(relative), found.labels.shape[1])
            for values, of_clear in zip(every, found, strict=True):
                values[rows] = of_clear
            return replace(self, minima=every)
        grown, limits = pair.heights(deviations), pair.minima.bulge(deviations)
        gaps = np.empty((len(relative), len(self.P_m)))
        poses, block = np.ascontiguousarray(relative), (self.raised, self.lowest, self.numbers)
        raised_kernel.write_low_gaps(self.compiled_points, poses, *block, limits, gaps)
        labels = pair.minima.find(relative, deviations, grown, self.P_m[None], gaps, limits, depth, in_steps=in_steps)
        labels = with_former(labels, self.minima.labels)
        if not labels.shape[1]:
            return replace(self, minima=GapMinima.none(len(relative)))
        places, heights = pair.minima.at(relative, deviations, labels)
        minima = GapMinima(places.labels, places.P_m, places.P_r, np.ascontiguousarray(places.n_r), heights + grown[:, None])
        return replace(self, minima=minima)


def raised_scan(scan: PairScan, deviations: Float[Array, "realization contributor"], *, always: bool = False) -> PairScan:
    """Return the scan of realizations with deviations; without many heights the same one, unless `always`."""
    if not isinstance(scan, CompiledScan) or (len(scan.columns) < MIN_HEIGHTS and not always):
        return scan
    raised = np.empty((len(deviations), len(scan.P_m)))
    lowest = np.empty((len(deviations), len(scan.leaves) - 1))
    heights, first = np.ascontiguousarray(deviations), scan.basis.shape[1]
    raised_kernel.sum_heights(scan.columns, scan.coordinates[first:], scan.leaves, heights, raised, lowest)
    return RaisedScan(
        **{name: getattr(scan, name) for name in PairScan.__dataclass_fields__},
        nominal=scan.contiguous,
        compiled_points=scan.compiled,
        raised=raised,
        lowest=lowest,
        numbers=np.arange(len(deviations)),
        minima=GapMinima.none(len(deviations)),
    )
