"""The gap of a contact point, paper (2) to (5), written once as an expression.

In the frame of the reference part it is affine in the relative pose X_RM, so all gaps of a pair are one product of
13 numbers (the pose's 12 entries, and 1) with a constant matrix: the Jacobian of the expression.
"""

import casadi as ca
import numpy as np

from tolcontact.discretization import ContactPoints
from tolcontact.mechanics.pose import ENTRIES, Pose, pose_of


def gap(X_RM: Pose, P_m: ca.SX, P_r: ca.SX, n_r: ca.SX) -> ca.SX:
    """Return the signed gap [mm] of paper (5), negative if the moving point lies inside the reference part.

    In the reference frame the normal n = R_r n^r of (4) is n^r. R_r must be a rotation.
    """
    return ca.dot(n_r, X_RM.apply(P_m) - P_r)


def gap_gradient() -> ca.Function:
    """Return the Function (P_m, P_r, n_r) -> (gradient of the gap by the 12 entries of X_RM, gap at X_RM = 0) of one point."""
    X_RM, P_m, P_r, n_r = ca.SX.sym("X_RM", ENTRIES), ca.SX.sym("P_m", 3), ca.SX.sym("P_r", 3), ca.SX.sym("n_r", 3)
    g = gap(pose_of(X_RM), P_m, P_r, n_r)
    constant = ca.substitute(g, X_RM, ca.SX.zeros(ENTRIES))
    return ca.Function("gap_gradient", [P_m, P_r, n_r], [ca.jacobian(g, X_RM).T, constant])


def gap_matrix(pair: ContactPoints) -> np.ndarray:
    """Return the constant matrix (13, point): gaps (point,) [mm] = [entries of X_RM, 1] @ matrix."""
    gradient, constant = gap_gradient().map(len(pair.P_m))(pair.P_m.T, pair.P_r.T, pair.n_r.T)
    return np.vstack([gradient.full(), constant.full()])
