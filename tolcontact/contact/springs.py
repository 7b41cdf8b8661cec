"""The law of supports that give way: they push with their stiffness times their compression, and do not pull."""

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float
from tolcontact.discretization import ContactPoints


def spring_misfit(
    pair: ContactPoints,
    relative: Float[Array, "n 12"],
    deviations: Float[Array, "n contributor"],
    reactions: Float[Array, "n point"],
) -> Float[Array, " n"]:
    """Return how far poses and reactions [N] of supports miss the law of their springs (n,) [mm].

    A rigid support among them may not be inside. `relative` (n, 12) are X_RM, `deviations` (n, contributor).
    """
    assert pair.stiffness is not None
    points = np.broadcast_to(np.arange(len(pair.P_m)), (len(relative), len(pair.P_m)))
    gaps = ((pose.apply(relative, pair.P_m) - pair.P_r) * pair.n_r).sum(axis=2) - pair.offsets.heights(deviations, points)
    compression = reactions / pair.stiffness
    return np.asarray(np.abs(np.minimum(gaps + compression, compression)).max(axis=1))
