"""Displacement fields (14): u = (R - I) v + t at surface points v, over all realizations.

u is linear in the 12 pose entries, so mean and spread of its components follow exactly from the mean and covariance of
those. Its magnitude is not: its powers are summed up as realizations pass.
"""

import numpy as np

from tolcontact.statistics import intervals, kernel

SOME = 256  # realizations whose mean magnitude is near enough to that of all


class FieldMoments:
    """Running moments of the displacement field of one part in one state."""

    def __init__(self, vertices: np.ndarray) -> None:
        """`vertices` (vertex, 3) [mm], nominal."""
        self._centre = vertices.mean(axis=0)
        self._v = np.hstack([vertices - self._centre, np.ones((len(vertices), 1))])
        self._points = np.ascontiguousarray(self._v[:, :3].T)
        self._count = np.zeros(1)
        self._mean = np.zeros((3, 4))
        self._scatter = np.zeros((3, 4, 4))
        # Sums of the magnitude's first to fourth power, from a shift near its mean, so that nothing cancels.
        self._shift = np.zeros(len(vertices))
        self._powers = np.zeros((4, len(vertices)))

    @property
    def state(self) -> np.ndarray:
        """Everything that was summed up, as one array of numbers; setting it goes on from there."""
        return np.concatenate([part.ravel() for part in self._parts])

    @state.setter
    def state(self, values: np.ndarray) -> None:
        start = 0
        for part in self._parts:
            part.ravel()[:] = values[start : start + part.size]
            start += part.size

    @property
    def _parts(self) -> tuple[np.ndarray, ...]:
        return self._count, self._mean, self._scatter, self._shift, self._powers

    def add(self, R: np.ndarray, t: np.ndarray) -> None:
        """Take in realizations: R (realization, 3, 3), t (realization, 3) [mm]."""
        turn = R - np.eye(3)
        # u = A (v - centre, 1), A (realization, 3, 4): turning about the part's middle keeps the sums free of cancellation.
        A = np.concatenate([turn, (turn @ self._centre + t)[:, :, None]], axis=2)
        n, before = len(A), self._count[0]
        mean = A.mean(axis=0)
        rest = A - mean
        step = mean - self._mean
        share = before * n / (before + n)
        self._scatter += np.einsum("kia,kib->iab", rest, rest) + share * np.einsum("ia,ib->iab", step, step)
        self._mean += step * n / (before + n)
        self._count += n

        if before == 0:
            some = np.zeros_like(self._powers)
            kernel.add_magnitudes(A[:SOME], self._points, self._shift, some)
            self._shift[:] = some[0] / min(n, SOME)
        kernel.add_magnitudes(A, self._points, self._shift, self._powers)

    def mean(self) -> np.ndarray:
        """Mean displacement (vertex, component) [mm]: x, y, z, magnitude."""
        return np.column_stack([self._v @ self._mean.T, self._shift + self._powers[0] / self._count])

    def six_sigma(self) -> np.ndarray:
        """Six standard deviations (vertex, component) [mm]: x, y, z, magnitude."""
        scatter = np.einsum("va,iab,vb->vi", self._v, self._scatter, self._v)
        spread = np.column_stack([scatter, self._central()[0] * self._count])
        return np.asarray(6 * np.sqrt(np.maximum(spread, 0) / max(self._count[0] - 1, 1)))

    def magnitude_bounds(self) -> np.ndarray:
        """95 % confidence interval of six standard deviations of the magnitude, (vertex, bound) [mm]."""
        _, lower, upper = intervals.of_moments(int(self._count[0]), *self._central())
        return np.asarray(6 * np.sqrt(np.column_stack([lower, upper])))

    def _central(self) -> tuple[np.ndarray, np.ndarray]:
        """Second and fourth central moment of the magnitude, (vertex,)."""
        m, s2, s3, s4 = self._powers / self._count
        return np.maximum(s2 - m**2, 0), np.maximum(s4 - 4 * m * s3 + 6 * m**2 * s2 - 3 * m**4, 0)
