"""Gaps of all contact points of a pair, what is active, and which points deserve a row of the QP.

Sums run over points in a fixed order, one realization independent of the others, so that results do not depend on
how realizations are grouped into blocks. (A BLAS product would be faster and would not keep that.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from tolcontact.discretization import ContactPoints
from tolcontact.simulation import kernel
from tolcontact.symbolic import MOMENTS


@dataclass(frozen=True, eq=False)
class PairScan:
    """Contact constants of a pair, its points sorted by spatial cluster.

    matrix             (13, point): gaps [mm] = [X_RM, 1] @ matrix
    tables             moment tables (moment, point) of the sides that enter the objective
    P_m, P_r, n_r      (point, 3)
    locators           columns of the deviations by which points stand out, (point,); None where none does
    clusters           slices of points that are neighbours
    """

    matrix: np.ndarray
    tables: tuple[np.ndarray, ...]
    P_m: np.ndarray
    P_r: np.ndarray
    n_r: np.ndarray
    locators: np.ndarray | None
    clusters: tuple[slice, ...]

    def take(self, rows: np.ndarray) -> "PairScan":
        """The scan for some of the realizations: here all have the same contact points."""
        return self

    def gaps(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        """Gaps (realization, point) [mm] for X_RM (realization, 12) and deviations (realization, locator) [mm]."""
        result = np.repeat(self.matrix[-1:], len(relative), axis=0)
        term = np.empty_like(result)
        for entry, row in zip(relative.T, self.matrix, strict=False):
            result += np.multiply(entry[:, None], row, out=term)
        return result if self.locators is None else result - deviations[:, self.locators]

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """P^m, P^r, n^r (realization, slot, 3) of some `points` (realization, slot): what their rows of the QP need."""
        P_m, P_r, n_r = self.P_m[points], self.P_r[points], self.n_r[points]
        if self.locators is None:
            return P_m, P_r, n_r
        height = np.take_along_axis(deviations, self.locators[points], axis=1)
        return P_m, P_r + height[..., None] * n_r, n_r

    def survey(self, relative: np.ndarray, deviations: np.ndarray, activity: float) -> "Survey":
        """What there is to see at X_RM (realization, 12): see Survey."""
        gaps = self.gaps(relative, deviations)
        active = gaps < activity
        sums = [[np.where(active, row, 0.0).sum(axis=1) for row in table] for table in self.tables]
        moments = np.array(sums).transpose(2, 0, 1) if sums else np.empty((len(active), 0, MOMENTS))
        return Survey(gaps.min(axis=1), active.sum(axis=1), moments)

    def deepest(
        self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The deepest point of each cluster and its depth, both (realization, cluster); depth [mm], > 0 inside.

        Only points where `may_carry` (realization, point) holds are looked at, if it is given.
        """
        gaps = self.gaps(relative, deviations)
        if may_carry is not None:
            gaps = np.where(may_carry, gaps, np.inf)
        points = np.stack([gaps[:, c].argmin(axis=1) + c.start for c in self.clusters], axis=1)
        return points, -np.take_along_axis(gaps, points, axis=1)


@dataclass(frozen=True, eq=False)
class Survey:
    """What a pass over the points of a pair finds in each realization.

    least      (realization,) least gap [mm]
    active     (realization,) number of points whose gap is below the activity
    moments    (realization, side, moment) of those
    """

    least: np.ndarray
    active: np.ndarray
    moments: np.ndarray


class CompiledScan(PairScan):
    """A scan whose passes are compiled; PairScan is the same in NumPy."""

    def survey(self, relative: np.ndarray, deviations: np.ndarray, activity: float) -> Survey:
        count = len(relative)
        found = Survey(np.empty(count), np.empty(count, dtype=np.int64), np.zeros((count, len(self.tables), MOMENTS)))
        poses, heights = np.ascontiguousarray(relative), np.ascontiguousarray(deviations)
        kernel.survey(
            self.matrix, self._tables, poses, heights, self._columns, activity, found.least, found.active, found.moments
        )
        return found

    def deepest(
        self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        points = np.empty((len(relative), len(self.clusters)), dtype=np.int64)
        gaps = np.empty(points.shape)
        poses, heights = np.ascontiguousarray(relative), np.ascontiguousarray(deviations)
        mask = np.empty((0, 0), dtype=bool) if may_carry is None else np.ascontiguousarray(may_carry)
        kernel.deepest(self.matrix, self._starts, poses, heights, self._columns, mask, points, gaps)
        return points, -gaps

    @cached_property
    def _tables(self) -> np.ndarray:
        """(side, moment, point)."""
        return np.array(self.tables).reshape(len(self.tables), MOMENTS, len(self.P_m))

    @cached_property
    def _starts(self) -> np.ndarray:
        """First point of each cluster, and the end."""
        return np.array([*(c.start for c in self.clusters), len(self.P_m)])

    @cached_property
    def _columns(self) -> np.ndarray:
        """The locators, none of them for a pair of faces."""
        return np.array([] if self.locators is None else self.locators, dtype=np.int64)


def pair_scan(pair: ContactPoints, matrix: np.ndarray, tables: list[np.ndarray], clusters: int) -> PairScan:
    """Sort the points of a pair into at most `clusters` clusters of neighbours; supports all have one of their own."""
    label = _cluster(pair.P_m, clusters if pair.locators is None else len(pair.P_m))
    order = np.argsort(label, kind="stable")
    ends = np.cumsum(np.bincount(label))
    slices = tuple(slice(int(a), int(b)) for a, b in zip([0, *ends[:-1]], ends, strict=True) if a < b)
    return CompiledScan(
        matrix=np.ascontiguousarray(matrix[:, order]),
        tables=tuple(np.ascontiguousarray(table[:, order]) for table in tables),
        P_m=pair.P_m[order],
        P_r=pair.P_r[order],
        n_r=pair.n_r[order],
        locators=None if pair.locators is None else pair.locators[order],
        clusters=slices,
    )


def _cluster(points: np.ndarray, clusters: int) -> np.ndarray:
    """Each point joins the nearest of `clusters` points that lie as far apart as possible."""
    if len(points) <= clusters:
        return np.arange(len(points))
    seeds = [int(np.argmax(((points - points.mean(axis=0)) ** 2).sum(axis=1)))]
    distance2 = ((points - points[seeds[0]]) ** 2).sum(axis=1)
    while len(seeds) < clusters:
        seeds.append(int(np.argmax(distance2)))
        np.minimum(distance2, ((points - points[seeds[-1]]) ** 2).sum(axis=1), out=distance2)
    return np.asarray(cKDTree(points[seeds]).query(points)[1])


def least_gaps(scans: Sequence[PairScan], relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
    """Least gap (row, pair) [mm] of each pair at X_RM (row, pair, 12)."""
    each = [scan.survey(relative[:, k], deviations, -np.inf).least for k, scan in enumerate(scans)]
    return np.stack(each, axis=1)
