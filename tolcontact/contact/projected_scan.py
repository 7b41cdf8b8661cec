"""Contact points that are projected again onto curved faces, at the poses of each realization."""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float
from tolcontact.contact.scan import Deepest, FixedScan, Scan


@dataclass(frozen=True, eq=False)
class ProjectedScan(Scan):
    """The points of a fixed scan, with separate projections for every realization.

    feet, normals    (realization, point, 3): P^r and n^r, nominal
    over             (realization, point): points that do not overhang the rim of the reference face; the others cannot touch
    """

    fixed: FixedScan
    feet: Float[Array, "realization point 3"]
    normals: Float[Array, "realization point 3"]
    over: Bool[Array, "realization point"]

    def take(self, rows: np.ndarray) -> "ProjectedScan":
        return ProjectedScan(self.fixed, self.feet[rows], self.normals[rows], self.over[rows])

    def gaps(
        self, relative: Float[Array, "realization 12"], deviations: Float[Array, "realization contributor"]
    ) -> Float[Array, "realization point"]:
        """Return gaps (realization, point) [mm], infinite for points beyond the rim."""
        fixed, n = self.fixed, self.normals
        offset = pose.apply(relative, fixed.pair.P_m) - self.feet
        gaps = n[..., 0] * offset[..., 0] + n[..., 1] * offset[..., 1] + n[..., 2] * offset[..., 2]
        if fixed.points.columns.size:
            gaps -= fixed.pair.offsets.heights(deviations, np.broadcast_to(np.arange(len(fixed.pair.P_m)), gaps.shape))
        return np.where(self.over, gaps, np.inf)

    def min_gap(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        return self.gaps(relative, deviations).min(axis=1)

    def deepest(self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None) -> Deepest:
        gaps = np.minimum(self.gaps(relative, deviations), 0)
        if may_carry is not None:
            gaps = np.where(may_carry, gaps, 0)
        firsts = self.fixed.points.leaves[self.fixed.points.branches[self.fixed.clusters]]
        points = np.stack([gaps[:, a:b].argmin(axis=1) + a for a, b in itertools.pairwise(firsts)], axis=1)
        return Deepest(points, -np.take_along_axis(gaps, points, axis=1))

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        feet, normals = (np.take_along_axis(values, points[..., None], axis=1) for values in (self.feet, self.normals))
        if self.fixed.points.columns.size:
            feet = feet + self.fixed.pair.offsets.heights(deviations, points)[..., None] * normals
        return self.fixed.pair.P_m[points], feet, normals


def half_spacing(P_m: Float[Array, "point 3"]) -> float:
    """Return half the usual spacing of contact points [mm]: the radius of the surroundings that each represents."""
    if len(P_m) < 2:
        return 0.0
    distance, _ = KDTree(P_m).query(P_m, k=2)
    return float(np.median(distance[:, 1])) / 2


def project(scan: FixedScan, relative: Float[Array, "realization 12"], margin: float) -> Scan:
    """Return the scan of a pair with every contact point projected again at X_RM (realization, 12). Supports stay as they are.

    Points that overhang the rim by up to `margin` [mm] still count, so that points at the rim do not appear and
    vanish with every step.
    """
    surface = scan.pair.reference_face
    if surface is None:
        return scan
    shape = (len(relative), len(scan.pair.P_m), 3)
    feet, normals, over = surface.project(pose.apply(relative, scan.pair.P_m).reshape(-1, 3), margin=margin)
    if scan.pair.coordinate_error:
        feet = feet - scan.pair.coordinate_error * normals
    return ProjectedScan(scan, feet.reshape(shape), normals.reshape(shape), over.reshape(shape[:2]))
