"""The objective (9), (11): half the sum of squared displacements of contact points, from ten moments of them.

The moments of points P about a nominal centre c are N, sum (P - c) and the six distinct entries of
sum (P - c)(P - c)': enough for every weighting of points, whatever their number.
"""

import casadi as ca
import numpy as np

from tolcontact.symbolic.correction import Twist
from tolcontact.symbolic.pose import Pose

MOMENTS = 10
_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def moment_table(P: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """What each point adds to the moments about `centre`, shape (moment, point), for points P (point, 3) [mm]."""
    p = (P - centre).T
    return np.vstack([np.ones(len(P)), p, *(p[i] * p[j] for i, j in _UPPER)])


def displacement_energy(moments: ca.SX, centre: np.ndarray, raw: Pose, twist: Twist) -> ca.SX:
    """1/2 sum |u_i|^2 [mm^2] over the points that `moments` (10, 1) sums up, displaced by `twist` from the raw pose."""
    count, first = moments[0], moments[1:4]
    second = ca.SX.zeros(3, 3)
    for k, (i, j) in enumerate(_UPPER):
        second[i, j] = second[j, i] = moments[4 + k]
    at_centre = twist.at(raw.place(ca.DM(centre)))
    arm = raw.R @ first
    spread = raw.R @ second @ raw.R.T
    inertia = ca.trace(second) * ca.SX.eye(3) - spread
    return (
        count * ca.dot(at_centre, at_centre) / 2
        + ca.dot(at_centre, ca.cross(twist.W, arm))
        + ca.dot(twist.W, inertia @ twist.W) / 2
    )
