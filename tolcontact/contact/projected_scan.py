"""Contact points that are projected again onto curved faces, at the poses of each realization."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float
from tolcontact.contact.scan import PairScan
from tolcontact.discretization import ContactPoints


@dataclass(frozen=True, eq=False)
class ProjectedScan(PairScan):
    """A scan with separate projections of the points for every realization.

    feet, normals    (realization, point, 3): P^r and n^r, nominal
    over             (realization, point): points that do not overhang the rim of the reference face; the others cannot touch
    """

    feet: Float[Array, "realization point 3"]
    normals: Float[Array, "realization point 3"]
    over: Bool[Array, "realization point"]

    def take(self, rows: np.ndarray) -> "ProjectedScan":
        return replace(self, feet=self.feet[rows], normals=self.normals[rows], over=self.over[rows])

    def gaps(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        offset = pose.apply(relative, self.P_m) - self.feet
        n = self.normals
        gaps = n[..., 0] * offset[..., 0] + n[..., 1] * offset[..., 1] + n[..., 2] * offset[..., 2]
        if self.columns.size:
            gaps -= self.offsets.heights(deviations, np.broadcast_to(np.arange(len(self.P_m)), gaps.shape))
        return np.where(self.over, gaps, np.inf)

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        feet, normals = (np.take_along_axis(values, points[..., None], axis=1) for values in (self.feet, self.normals))
        if self.columns.size:
            feet = feet + self.offsets.heights(deviations, points)[..., None] * normals
        return self.P_m[points], feet, normals


def half_spacing(scan: PairScan) -> float:
    """Return half the usual spacing of contact points [mm]: the radius of the surroundings that each represents."""
    if len(scan.P_m) < 2:
        return 0.0
    distance, _ = KDTree(scan.P_m).query(scan.P_m, k=2)
    return float(np.median(distance[:, 1])) / 2


def project(scan: PairScan, pair: ContactPoints, relative: Float[Array, "realization 12"], margin: float) -> PairScan:
    """Return the scan of a pair with every contact point projected again at X_RM (realization, 12). Supports stay as they are.

    Points that overhang the rim by up to `margin` [mm] still count, so that points at the rim do not appear and
    vanish with every step.
    """
    surface = pair.reference_face
    if surface is None:
        return scan
    shape = (len(relative), len(scan.P_m), 3)
    feet, normals, over = surface.project(pose.apply(relative, scan.P_m).reshape(-1, 3), margin=margin)
    if pair.coordinate_error:
        feet = feet - pair.coordinate_error * normals
    return ProjectedScan(
        **{name: getattr(scan, name) for name in PairScan.__dataclass_fields__},
        feet=feet.reshape(shape),
        normals=normals.reshape(shape),
        over=over.reshape(shape[:2]),
    )
