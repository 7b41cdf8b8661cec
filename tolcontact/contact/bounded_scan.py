"""Scans of bodies as they end: the places at which they can touch are found anew at every pose."""

from dataclasses import dataclass

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.contact.scan import Deepest, Scan, SlotScan
from tolcontact.geometry.kernel import CORNER_ON_FACET
from tolcontact.geometry.meeting import Meeting


@dataclass(frozen=True, eq=False)
class BoundedScan(SlotScan):
    """Places at which a pair can touch, found at some poses: those of the least gaps, of every realization its own.

    labels              (realization, place): numbers of the places among those of the pair's meeting
    places, feet, normals   (realization, place, 3): P^m, P^r, n^r
    heights             (realization,) [mm] by which both faces have grown
    """

    meeting: Meeting
    labels: Int[Array, "realization place"]
    places: Float[Array, "realization place 3"]
    feet: Float[Array, "realization place 3"]
    normals: Float[Array, "realization place 3"]
    valid: Bool[Array, "realization place"]
    heights: Float[Array, " realization"]

    def take(self, rows: np.ndarray) -> "BoundedScan":
        return BoundedScan(
            self.tables, self.P_m, self.offsets, self.meeting,
            *(getattr(self, name)[rows] for name in ("labels", "places", "feet", "normals", "valid", "heights")),
        )  # fmt: skip

    def gaps(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        x = np.einsum("kij,kpj->kpi", pose.rotation(relative), self.places) + relative[:, None, 9:]
        gaps = ((x - self.feet) * self.normals).sum(axis=2) - self.heights[:, None]
        return np.where(self.valid, gaps, np.inf)

    def min_gap(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        return self.gaps(relative, deviations).min(axis=1, initial=np.inf)

    def deepest(self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None) -> Deepest:
        # Each place is a cluster of its own.
        return Deepest(np.maximum(self.labels, 0), -np.minimum(self.gaps(relative, deviations), 0))

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        column = (points[:, :, None] == self.labels[:, None, :]).argmax(axis=2)[..., None]
        P_m, P_r, n_r = (np.take_along_axis(array, column, axis=1) for array in (self.places, self.feet, self.normals))
        return P_m, P_r + self.heights[:, None, None] * n_r, n_r

    def holds(self, points: Int[Array, "realization slot"]) -> Bool[Array, "realization slot"]:
        return ((points[:, :, None] == self.labels[:, None, :]) & self.valid[:, None, :]).any(axis=2)

    def moves(self, points: np.ndarray) -> np.ndarray:
        return self.meeting.kinds[points] == CORNER_ON_FACET


def bounded_scan(
    scan: Scan,
    meeting: Meeting,
    X_RM: Float[Array, "n 12"],
    heights: Float[Array, " n"],
    kept: Int[Array, "n k"] | None = None,
    error: float = 0.0,
) -> BoundedScan:
    """Return the places at which a pair can touch at X_RM (n, 12); see Meeting.at for `kept` and `error`."""
    found = meeting.at(X_RM, kept, error)
    arrays = found.labels, found.P_m, found.P_r, found.n_r, np.isfinite(found.gaps)
    return BoundedScan(scan.tables, scan.P_m, scan.offsets, meeting, *arrays, heights)
