"""A scan of faces with form: heights of all points are summed up once for each realization, not in every pass.

The smallest gap of a leaf follows from the gaps of its nominal points and its largest height. Planes also touch at local minima
of the gap between their points, which are searched from the deepest point of each leaf.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.contact import kernel
from tolcontact.contact.scan import Deepest, FixedScan, Scan
from tolcontact.discretization import ContactPoints
from tolcontact.discretization.plane_minima import with_former
from tolcontact.geometry.minima_kernel import FIRST_PLACE
from tolcontact.geometry.places import Places

MIN_HEIGHTS = 4  # that vary independently: fewer are as fast in every pass


@dataclass(frozen=True, eq=False)
class RaisedScan(FixedScan):
    """A scan of some of the realizations of a block: the nominal points, with their heights in these realizations.

    minima    of the gap between the points

    The lowest points of clusters take the remaining slots, too: faces with form end up on a few points anywhere, and fewer QPs
    find these points if all sides of the faces have rows from the first QP on.
    """

    fills = True

    minima: Places = field(kw_only=True)

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
        points, depth = super().deepest(relative, deviations, may_carry)
        if self.minima.labels.shape[1]:
            points = np.concatenate([points, np.maximum(self.minima.labels, 0)], axis=1)
            depth = np.concatenate([depth, -self.minima.gaps_at(relative)], axis=1)
        return Deepest(points, depth)

    def depth_between(self, relative: np.ndarray) -> np.ndarray:
        return -self.minima.gaps_at(relative).min(axis=1, initial=0.0)

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
            minima = self.take(rows).with_minima(pair, relative[rows], deviations[rows], depth).minima
            return replace(self, minima=minima.among(len(relative), rows))
        grown, limits = pair.heights(deviations), pair.minima.bulge(deviations)
        gaps = self.gaps(relative, deviations, limits)
        labels = pair.minima.find(relative, deviations, grown, self.pair.P_m[None], gaps, limits, depth, in_steps=in_steps)
        labels = with_former(labels, self.minima.labels)
        if not labels.shape[1]:
            return replace(self, minima=Places.none(len(relative)))
        minima = pair.minima.at(relative, deviations, labels)
        return replace(self, minima=minima._replace(heights=minima.heights + grown[:, None]))


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
    return RaisedScan(scan.pair, scan.nominal_points, scan.clusters, scan.tables, raised, minima=Places.none(count))
