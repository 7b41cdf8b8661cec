"""Importance sampling from a mixture of standard normals around realizations in an event."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import cluster, special

from tolcontact.statistics.rare.searches import Score

CENTRE_COUNTS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)  # trial numbers of centres
MIN_PER_CENTRE = 4
MAX_FITTED = 1500  # realizations
MIN_GAIN = 0.01  # of the mean log-likelihood: smallest gain that justifies another centre
ITERATIONS = 10
FEW_DIMENSIONS, NOISE = 10, 5.0  # with more dimensions, this many standard errors of a centre are noise


class Mixture(NamedTuple):
    """Standard normals around `centres` (k, d), with `shares` (k,)."""

    centres: np.ndarray
    shares: np.ndarray

    def log_ratio(self, u: np.ndarray) -> np.ndarray:
        """Return the logarithm of the mixture density over the standard normal density, at u (n, d)."""
        exponents = u @ self.centres.T - 0.5 * (self.centres**2).sum(axis=1)
        return np.asarray(special.logsumexp(exponents + np.log(self.shares), axis=1))

    def nearest(self, u: np.ndarray) -> np.ndarray:
        """Return the index of the centre with the largest likelihood of each realization u (n, d)."""
        return np.asarray(np.argmax(u @ self.centres.T - 0.5 * (self.centres**2).sum(axis=1), axis=1))

    def flattened(self) -> "Mixture":
        """Return the mixture with shares half as far from equal shares, since small clusters are equally important."""
        return self._replace(shares=0.5 * self.shares + 0.5 / len(self.shares))

    def weights(self, score: Score, count: int, dimensions: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return realizations of the mixture (count, d), and their weights (count,), which are 0 outside the event."""
        numbers = rng.choice(len(self.shares), size=count, p=self.shares)
        u, w = rng.standard_normal((count, dimensions)) + self.centres[numbers], np.zeros(count)
        hits = np.flatnonzero(score(u) > 0)
        w[hits] = np.exp(-self.log_ratio(u[hits]))
        return u, w


def joined(mixtures: Sequence[Mixture], shares: Sequence[float]) -> Mixture:
    """Return a mixture of mixtures."""
    return Mixture(
        np.concatenate([mixture.centres for mixture in mixtures]),
        np.concatenate([share * mixture.shares for mixture, share in zip(mixtures, shares, strict=True)]),
    )


def fitted(groups: Sequence[np.ndarray], rng: np.random.Generator) -> Mixture:
    """Return a mixture fitted to independent groups (n, d).

    The number of centres is chosen by cross-validation: a fit to one half of the groups is evaluated on the other half.
    """
    limit = MAX_FITTED // len(groups)
    groups = [group[rng.choice(len(group), min(len(group), limit), replace=False)] for group in groups]
    number = 4
    if len(groups) > 1:
        training, validation = np.concatenate(groups[::2]), np.concatenate(groups[1::2])
        best = -np.inf
        for candidate in CENTRE_COUNTS:
            if candidate > max(len(training) // MIN_PER_CENTRE, 1):
                break
            likelihood = float(_clustered(training, candidate, rng).log_ratio(validation).mean())
            if likelihood > best + MIN_GAIN:
                best, number = likelihood, candidate
    return _clustered(np.concatenate(groups), number, rng)


def _clustered(points: np.ndarray, number: int, rng: np.random.Generator) -> Mixture:
    """Return the clusters of points (n, d) by k-means, with k-means++ starts, and their shares."""
    distinct = len(np.unique(points, axis=0))
    centres, labels = cluster.vq.kmeans2(points, min(number, distinct), iter=ITERATIONS, minit="++", missing="warn", rng=rng)
    shares = np.bincount(labels, minlength=len(centres)) / len(points)
    if points.shape[1] > FEW_DIMENSIONS:
        # Means of contributors without influence are noise; in many dimensions it would spread the weights.
        sizes = np.array([len(np.unique(points[labels == label], axis=0)) for label in range(len(centres))])
        centres = np.where(np.abs(centres) * np.sqrt(sizes)[:, None] < NOISE, 0.0, centres)
    return Mixture(centres[shares > 0], shares[shares > 0])
