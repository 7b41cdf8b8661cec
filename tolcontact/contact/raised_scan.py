"""A scan of faces with form: heights of all points are summed up once for each realization, not in every pass.

The least gap of a leaf follows from the gaps of its nominal points and its largest height.
"""

from dataclasses import dataclass, replace

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.contact import kernel, raised_kernel
from tolcontact.contact.scan import CompiledScan, Deepest, PairScan

MIN_HEIGHTS = 4  # that vary independently: fewer are as quick in every pass


@dataclass(frozen=True, eq=False)
class RaisedScan(CompiledScan):
    """A scan of some of the realizations of a block.

    nominal          P_m, P_r, n_r (point, 3) of nominal faces
    compiled_points  of these
    raised           (realization of the block, point) [mm]: added to the gaps of nominal faces, below 0 where faces stand out
    lowest           (realization of the block, leaf) [mm]: the least of these
    numbers          (realization,): numbers of the realizations in the block

    The lowest points of clusters take the slots that are left, too: faces with form end up on few points anywhere, and fewer
    QPs find these if all sides of the faces have rows from the first one on.
    """

    fills = True

    nominal: tuple[np.ndarray, np.ndarray, np.ndarray]
    compiled_points: kernel.Points
    raised: Float[Array, "m point"]
    lowest: Float[Array, "m leaf"]
    numbers: Int[Array, " realization"]

    def take(self, rows: np.ndarray) -> "RaisedScan":
        return replace(self, numbers=self.numbers[rows])

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        P_m, P_r, n_r = (np.empty((*points.shape, 3)) for _ in range(3))
        raised_kernel.gather(*self.nominal, self.raised, self.numbers, np.ascontiguousarray(points), P_m, P_r, n_r)
        return P_m, P_r, n_r

    def deepest(self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None) -> Deepest:
        points, gaps = self._deepest(self.clusters, relative, deviations, may_carry, np.inf)
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


def raised_scan(scan: PairScan, deviations: Float[Array, "realization contributor"]) -> PairScan:
    """Return the scan of realizations with deviations (realization, contributor); the same one without many heights."""
    if not isinstance(scan, CompiledScan) or len(scan.columns) < MIN_HEIGHTS:
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
    )
