"""Symbolic poses X = (R, t): x = R x0 + t, paper (1), with x0 in the nominal assembly frame.

As a vector a pose has 12 entries: R row by row, then t [mm].
"""

from typing import NamedTuple

import casadi as ca
import numpy as np

from tolcontact import poses

ENTRIES = poses.ENTRIES

Number = float | ca.SX  # a number of the model, or its symbol in a function that several pairs share
Vector = np.ndarray | ca.SX

POLAR_STEPS = 4  # of Newton's method, from a nearly orthogonal matrix
# Keeps sqrt differentiable at theta = 0. Its square root is far below any angle, so the formulas below stay exact.
_TINY = 1e-300


class Pose(NamedTuple):
    """A pose: R (3, 3) and t (3, 1) [mm]."""

    R: ca.SX
    t: ca.SX

    def __matmul__(self, inner: "Pose") -> "Pose":  # type: ignore[override]
        """Return the composition: first `inner`, then this pose."""
        return Pose(self.R @ inner.R, self.R @ inner.t + self.t)

    def apply(self, p: ca.SX | ca.DM) -> ca.SX:
        """Return the position of the point with nominal coordinates `p` (3, 1) [mm]."""
        return self.R @ p + self.t

    def vector(self) -> ca.SX:
        """Return the 12 entries."""
        return ca.vertcat(ca.vec(self.R.T), self.t)


def constant(values: Vector) -> ca.SX | ca.DM:
    """Return numbers (n,) as a CasADi matrix (n, 1); symbols are returned unchanged."""
    return values if isinstance(values, ca.SX) else ca.DM(values)


def pose_of(vector: ca.SX) -> Pose:
    """Return the pose whose 12 entries are `vector`."""
    return Pose(ca.reshape(vector[:9], 3, 3).T, vector[9:12])


def poses_of(vector: ca.SX) -> list[Pose]:
    """Return the poses whose entries are concatenated in `vector`."""
    return [pose_of(part) for part in ca.vertsplit(vector, ENTRIES)]


def rotation(theta: ca.SX) -> ca.SX:
    """Return exp([theta]x) by Rodrigues' formula; it is exact and differentiable down to theta = 0 [rad]."""
    angle = ca.sqrt(ca.dot(theta, theta) + _TINY)
    half = ca.sin(angle / 2) / (angle / 2)
    K = ca.skew(theta)
    return ca.SX.eye(3) + (ca.sin(angle) / angle) * K + (half**2 / 2) * (K @ K)


def nearest_rotation(R: ca.SX) -> ca.SX:
    """Return the rotation nearest to a nearly orthogonal matrix R (3, 3), by Newton's iteration for its polar factor."""
    for _ in range(POLAR_STEPS):
        R = R @ (3 * ca.SX.eye(3) - R.T @ R) / 2
    return R


def relative(X_WM: Pose, X_WR: Pose) -> Pose:
    """Return X_RM, the pose of the moving part in the frame of the reference part."""
    return Pose(X_WR.R.T @ X_WM.R, X_WR.R.T @ (X_WM.t - X_WR.t))


def congruent(B: ca.SX, A: ca.SX) -> ca.SX:
    """Return A'BA (n, n) for a symmetric B (m, m) and A (m, n). The lower triangle is a copy of the upper one."""
    product = B @ A
    entries = ca.triu(ca.mtimes(A.sparsity().T, product.sparsity()))
    return ca.triu2symm(ca.mac(A.T, product, ca.SX.zeros(entries)))
