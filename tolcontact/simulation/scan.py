"""Gaps of all contact points of a pair, what is active, and which points deserve a row of the QP.

Sums run over points in a fixed order, one realization independent of the others, so that results do not depend on
how realizations are grouped into blocks. (A BLAS product would be faster and would not keep that.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tolcontact.discretization import ContactPoints


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

    def moments(self, active: np.ndarray) -> np.ndarray:
        """Moments (realization, side, moment) of the points where `active` (realization, point)."""
        sums = [[np.where(active, row, 0.0).sum(axis=1) for row in table] for table in self.tables]
        return np.array(sums).transpose(2, 0, 1) if sums else np.empty((len(active), 0, 0))

    def deepest(self, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The deepest point of each cluster and its depth, both (realization, cluster); depth [mm], > 0 inside."""
        points = np.stack([gaps[:, c].argmin(axis=1) + c.start for c in self.clusters], axis=1)
        return points, -np.take_along_axis(gaps, points, axis=1)


def pair_scan(pair: ContactPoints, matrix: np.ndarray, tables: list[np.ndarray], clusters: int) -> PairScan:
    """Sort the points of a pair into at most `clusters` clusters of neighbours; supports all have one of their own."""
    label = _cluster(pair.P_m, clusters if pair.locators is None else len(pair.P_m))
    order = np.argsort(label, kind="stable")
    ends = np.cumsum(np.bincount(label))
    slices = tuple(slice(int(a), int(b)) for a, b in zip([0, *ends[:-1]], ends, strict=True) if a < b)
    return PairScan(
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


def gaps_of(scans: Sequence[PairScan], relative: np.ndarray, deviations: np.ndarray) -> list[np.ndarray]:
    """Gaps (row, point) [mm] of each pair at X_RM (row, pair, 12)."""
    return [scan.gaps(relative[:, k], deviations) for k, scan in enumerate(scans)]
