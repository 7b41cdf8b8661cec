"""Displacement fields (14): u = (R - I) v + t at surface points v, over all realizations.

u is linear in the 12 pose entries, so mean and spread of its components follow exactly from the mean and covariance of
those. Its magnitude does not: |u|^2 is a quadratic form of (v, 1) with ten coefficients per realization, summed up as
realizations pass.
"""

import numpy as np

SLICE = 256
_PAIRS = tuple((i, j) for i in range(4) for j in range(i, 4))


class FieldMoments:
    """Running moments of the displacement field of one part in one state."""

    def __init__(self, vertices: np.ndarray) -> None:
        """`vertices` (vertex, 3) [mm], nominal."""
        self._centre = vertices.mean(axis=0)
        self._v = np.hstack([vertices - self._centre, np.ones((len(vertices), 1))])
        self._quadratic = np.stack([(1 if i == j else 2) * self._v[:, i] * self._v[:, j] for i, j in _PAIRS])
        self._count = 0
        self._mean = np.zeros((3, 4))
        self._scatter = np.zeros((3, 4, 4))
        self._magnitude_mean = np.zeros(len(vertices))
        self._magnitude_scatter = np.zeros(len(vertices))

    def add(self, R: np.ndarray, t: np.ndarray) -> None:
        """Take in realizations: R (realization, 3, 3), t (realization, 3) [mm]."""
        turn = R - np.eye(3)
        # u = A (v - centre, 1), A (realization, 3, 4): turning about the part's middle keeps the sums free of cancellation.
        A = np.concatenate([turn, (turn @ self._centre + t)[:, :, None]], axis=2)
        for start in range(0, len(A), SLICE):
            self._add(A[start : start + SLICE])

    def _add(self, A: np.ndarray) -> None:
        n, total = len(A), self._count + len(A)
        mean = A.mean(axis=0)
        rest = A - mean
        step = mean - self._mean
        share = self._count * n / total
        self._scatter += np.einsum("kia,kib->iab", rest, rest) + share * np.einsum("ia,ib->iab", step, step)
        self._mean += step * n / total

        G = np.einsum("kia,kib->kab", A, A)
        coefficients = np.stack([G[:, i, j] for i, j in _PAIRS], axis=1)
        magnitude = np.sqrt(np.maximum(coefficients @ self._quadratic, 0))
        mean_magnitude = magnitude.mean(axis=0)
        step_magnitude = mean_magnitude - self._magnitude_mean
        self._magnitude_scatter += ((magnitude - mean_magnitude) ** 2).sum(axis=0) + share * step_magnitude**2
        self._magnitude_mean += step_magnitude * n / total
        self._count = total

    def mean(self) -> np.ndarray:
        """Mean displacement (vertex, component) [mm]: x, y, z, magnitude."""
        return np.column_stack([self._v @ self._mean.T, self._magnitude_mean])

    def six_sigma(self) -> np.ndarray:
        """Six standard deviations (vertex, component) [mm]: x, y, z, magnitude."""
        scatter = np.einsum("va,iab,vb->vi", self._v, self._scatter, self._v)
        spread = np.column_stack([scatter, self._magnitude_scatter])
        return np.asarray(6 * np.sqrt(np.maximum(spread, 0) / max(self._count - 1, 1)))


def displacement(R: np.ndarray, t: np.ndarray, v: np.ndarray) -> np.ndarray:
    """u (realization, 3) [mm] of one point v (3,) [mm] for R (realization, 3, 3), t (realization, 3) [mm]. Paper (14)."""
    return np.asarray((R - np.eye(3)) @ v + t)
