"""Batches of poses as arrays (..., 12): R row by row, then t [mm]; a point p goes to R p + t."""

import numpy as np

ENTRIES = 12
AT_REST = np.concatenate([np.eye(3).ravel(), np.zeros(3)])


def rotation(X: np.ndarray) -> np.ndarray:
    """Return R (..., 3, 3)."""
    return X[..., :9].reshape(*X.shape[:-1], 3, 3)


def translation(X: np.ndarray) -> np.ndarray:
    """Return t (..., 3) [mm]."""
    return X[..., 9:]


def pose(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the poses (..., 12) of R (..., 3, 3) and t (..., 3) [mm]."""
    return np.concatenate([R.reshape(*R.shape[:-2], 9), t], axis=-1)


def apply(X: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return where points p (point, 3) [mm] are at the poses X (..., 12): (..., point, 3) [mm]."""
    R, t = X[..., None, :9], X[..., None, 9:]
    columns = [
        R[..., 3 * i] * p[..., 0] + R[..., 3 * i + 1] * p[..., 1] + R[..., 3 * i + 2] * p[..., 2] + t[..., i] for i in range(3)
    ]
    return np.stack(columns, axis=-1)


def compose(X: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Return the motion that is first `inner`, then X."""
    R = rotation(X)
    return pose(R @ rotation(inner), np.einsum("...ij,...j->...i", R, inner[..., 9:]) + X[..., 9:])


def inverse(X: np.ndarray) -> np.ndarray:
    """Return the motion back, also of poses that stretch a little, as paper (12) gives them."""
    back = np.linalg.inv(rotation(X))
    return pose(back, -np.einsum("...ij,...j->...i", back, X[..., 9:]))


def relative(X_WM: np.ndarray, X_WR: np.ndarray) -> np.ndarray:
    """Return X_RM, the poses of the moving part in the frame of the reference part."""
    return compose(inverse(X_WR), X_WM)


def turn(X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Return the angle (...) [rad], from 0 to pi, between the rotations of two poses."""
    difference = ((X[..., :9] - Y[..., :9]) ** 2).sum(axis=-1)  # |R - S|^2 = 8 sin^2(angle / 2)
    return np.asarray(2 * np.arcsin(np.sqrt(np.minimum(difference / 8, 1))))
