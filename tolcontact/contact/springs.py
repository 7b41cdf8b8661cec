"""The law of compliant contact: it pushes with its stiffness times its compression, and does not pull."""

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float
from tolcontact.contact.scan import Scan
from tolcontact.discretization import ContactPoints


def spring_misfit(
    pair: ContactPoints,
    scan: Scan,
    relative: Float[Array, "n 12"],
    deviations: Float[Array, "n contributor"],
    reactions: Float[Array, "n point"],
) -> Float[Array, " n"]:
    """Return how far poses and reactions [N] of a pair miss the law of its springs (n,) [mm].

    A rigid support among them may not be inside. `relative` (n, 12) are X_RM, `deviations` (n, contributor).
    """
    assert pair.stiffness is not None
    gaps = scan.gaps(relative, deviations) if pair.round else _fixed_gaps(pair, relative, deviations)
    compression = reactions / pair.stiffness
    return np.asarray(np.abs(np.minimum(gaps + compression, compression)).max(axis=1))


def _fixed_gaps(pair: ContactPoints, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
    """Return the gaps (n, point) [mm] of contact points in the order of their rows."""
    points = np.broadcast_to(np.arange(len(pair.P_m)), (len(relative), len(pair.P_m)))
    heights = pair.offsets.heights(deviations, points)
    return np.asarray(((pose.apply(relative, pair.P_m) - pair.P_r) * pair.n_r).sum(axis=2) - heights)
