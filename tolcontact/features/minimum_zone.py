"""The minimum zone of a face with form: between two planes, coaxial cylinders, or concentric circles or spheres.

Its width is twice the smallest possible largest distance of the heights from the centre of the zone, over all displacements of
the zone (minimax, or Chebyshev fit). That is a linear programme. Its dual has one more point than the zone has freedoms: points
are exchanged until all others are within the zone.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from tolcontact.features.zone_kernel import exchange

MAX_EXCHANGES = 200
CLOSENESS = 1e-9  # of the width: points that are no further out are in the zone
SHIFT = 1e-8  # of the extent: shifts of points, since exchanges among collinear points may cycle


class ZoneMember(NamedTuple):
    """A part of a face that has a zone of its own: a whole surface, a circle, a line.

    indices   (k,) of its places among the places of the face
    rows      (k, freedom): heights of displacements and growths of the zone, each at most 1, the uniform one first
    """

    indices: np.ndarray
    rows: np.ndarray


def minimum_widths(zone: Sequence[ZoneMember], heights: np.ndarray) -> np.ndarray:
    """Return the widths (n,) [mm] of the minimum zones of heights (n, place) [mm]: of the widest member each."""
    return np.max([minimax(member.rows, heights[:, member.indices])[1] for member in zone], axis=0)


def minimax(rigid: np.ndarray, heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the centres (n, freedom) and widths (n,) [mm] of the minimum zones of heights (n, place) [mm].

    rigid   (place, freedom): heights of unit displacements, the uniform one first
    """
    shifted = rigid + SHIFT * np.random.default_rng(0).uniform(-1, 1, rigid.shape) * [0, *[1] * (rigid.shape[1] - 1)]
    initial, fields = _initial_points(shifted), np.ascontiguousarray(heights, dtype=float)
    signs = np.where(np.linalg.svd(shifted[initial].T)[2][-1] < 0, -1.0, 1.0)
    centres, widths = np.zeros((len(fields), rigid.shape[1])), np.zeros(len(fields))
    exact, rows = (np.ascontiguousarray(matrix.T) for matrix in (rigid, shifted))
    exchange(fields, exact, rows, initial, signs, MAX_EXCHANGES, CLOSENESS, centres, widths)
    for row in np.flatnonzero(np.isnan(widths)):
        centres[row], widths[row] = _by_programme(rigid, fields[row])
    return centres, widths


def _initial_points(rigid: np.ndarray) -> np.ndarray:
    """Return the indices (freedom + 1,) of well-conditioned starting points."""
    remainder, indices = rigid.copy(), list[int]()
    for _ in range(rigid.shape[1]):
        indices.append(int((remainder**2).sum(axis=1).argmax()))
        direction = remainder[indices[-1]] / np.linalg.norm(remainder[indices[-1]])
        remainder = remainder - np.outer(remainder @ direction, direction)
    shares = np.linalg.solve(rigid[indices].T, rigid.T)  # of these points in each other point
    smallest = np.abs(shares).min(axis=0)
    smallest[indices] = -1.0
    return np.array([*indices, int(smallest.argmax())])


def _by_programme(rigid: np.ndarray, heights: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the centre (freedom,) and the width of the minimum zone by a solver of linear programmes."""
    scale, ones = max(float(np.ptp(heights)), 1e-300), np.ones((len(heights), 1))
    solution = scipy.optimize.linprog(
        np.append(np.zeros(rigid.shape[1]), 1.0),
        A_ub=np.block([[rigid, -ones], [-rigid, -ones]]),
        b_ub=np.concatenate([heights, -heights]) / scale,
        bounds=[(None, None)] * rigid.shape[1] + [(0, None)],
        method="highs-ds",
    )
    return scale * solution.x[:-1], float(2 * scale * solution.fun)
