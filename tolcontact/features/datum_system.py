"""Datum systems: how the frame moves that deviating datum features establish, and what they leave open (ISO 5459)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tolcontact.features.feature_geometry import FeatureGeometry

NOTICED = 1e-4  # smallest singular value, beside the largest, of a displacement that a datum notices


class Datum(NamedTuple):
    """A datum feature, and its coordinates (coordinate, column) for deviations of 1."""

    geometry: FeatureGeometry
    coordinates: np.ndarray


class DatumFrame(NamedTuple):
    """The frame of a datum system, for displacements (tau, rho) about one centre.

    motion   (6, column) of the frame for deviations of 1
    free     (6, freedom): displacements that none of the datums notices
    """

    motion: np.ndarray
    free: np.ndarray


def datum_frame(system: Sequence[Sequence[Datum]], centre: np.ndarray, reach: float, columns: int) -> DatumFrame:
    """The frame of datums in their precedence: each takes the freedoms that it notices of those left by the ones before.

    Datums of one place count together, in the sense of least squares of their coordinates. Angles are weighed by `reach` [mm].
    """
    to_twist = np.diag([1.0] * 3 + [1 / reach] * 3)
    motion, free = np.zeros((6, columns)), np.eye(6)
    for place in system:
        notices = np.vstack([datum.geometry.about(centre) for datum in place]) @ to_twist
        wanted = np.vstack([datum.coordinates for datum in place])
        seen = notices @ free
        U, S, Vt = np.linalg.svd(seen)
        rank = int((S > NOTICED * max(S.max(initial=0.0), 1e-300)).sum()) if S.max(initial=0.0) > NOTICED else 0
        if rank:
            inverse = Vt[:rank].T @ (U[:, :rank] / S[:rank]).T
            motion = motion + free @ inverse @ (wanted - notices @ motion)
        free = free @ Vt[rank:].T
    return DatumFrame(to_twist @ motion, to_twist @ free)
