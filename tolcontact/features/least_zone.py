"""The narrowest zone that contains a face with form: between two planes, coaxial cylinders, or concentric circles or spheres.

Its width is the least, over displacements of the zone, of the largest distance of heights from its middle, doubled. That is a
linear programme. Its dual has one more point than the zone has freedoms: points are exchanged until none is farther out.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from tolcontact.features.zone_kernel import exchange

MAX_EXCHANGES = 200
FARTHER = 1e-9  # of the width: points that are no farther out are in the zone
SHIFT = 1e-8  # of the extent: shifts of points, since exchanges among points in line may cycle


class ZoneMember(NamedTuple):
    """A part of a face that has a zone of its own: a whole surface, a circle, a line.

    numbers   (k,) of its places among those of the face
    rows      (k, freedom): heights of displacements and growths of the zone, each at most 1, that of 1 everywhere first
    """

    numbers: np.ndarray
    rows: np.ndarray


def least_widths(zone: Sequence[ZoneMember], heights: np.ndarray) -> np.ndarray:
    """Return the widths (n,) [mm] of the least zones of heights (n, place) [mm]: of the widest member each."""
    return np.max([_widths(member.rows, heights[:, member.numbers]) for member in zone], axis=0)


def _widths(rigid: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Return the widths (n,) [mm] of the least zones of heights (n, place) [mm] of a member."""
    _, widths = middles(rigid, heights)
    return widths


def middles(rigid: np.ndarray, heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles (n, freedom) and widths (n,) [mm] of the least zones of heights (n, place) [mm].

    rigid   (place, freedom): heights of displacements of 1, that of 1 everywhere first
    """
    shifted = rigid + SHIFT * np.random.default_rng(0).uniform(-1, 1, rigid.shape) * [0, *[1] * (rigid.shape[1] - 1)]
    first, fields = _spread_points(shifted), np.ascontiguousarray(heights, dtype=float)
    signs = np.where(np.linalg.svd(shifted[first].T)[2][-1] < 0, -1.0, 1.0)
    solutions, widths = np.zeros((len(fields), rigid.shape[1])), np.zeros(len(fields))
    exact, rows = (np.ascontiguousarray(matrix.T) for matrix in (rigid, shifted))
    exchange(fields, exact, rows, first, signs, MAX_EXCHANGES, FARTHER, solutions, widths)
    for row in np.flatnonzero(np.isnan(widths)):
        solutions[row], widths[row] = _by_programme(rigid, fields[row])
    return solutions, widths


def _spread_points(rigid: np.ndarray) -> np.ndarray:
    """Return the numbers of as many points as there are freedoms, and one more, that are far from dependent."""
    remainder, numbers = rigid.copy(), list[int]()
    for _ in range(rigid.shape[1]):
        numbers.append(int((remainder**2).sum(axis=1).argmax()))
        direction = remainder[numbers[-1]] / np.linalg.norm(remainder[numbers[-1]])
        remainder = remainder - np.outer(remainder @ direction, direction)
    shares = np.linalg.solve(rigid[numbers].T, rigid.T)  # of the points before in each other point
    smallest = np.abs(shares).min(axis=0)
    smallest[numbers] = -1.0
    return np.array([*numbers, int(smallest.argmax())])


def _by_programme(rigid: np.ndarray, heights: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the middle (freedom,) and the width of the least zone by a solver of linear programmes."""
    scale, ones = max(float(np.ptp(heights)), 1e-300), np.ones((len(heights), 1))
    solution = scipy.optimize.linprog(
        np.append(np.zeros(rigid.shape[1]), 1.0),
        A_ub=np.block([[rigid, -ones], [-rigid, -ones]]),
        b_ub=np.concatenate([heights, -heights]) / scale,
        bounds=[(None, None)] * rigid.shape[1] + [(0, None)],
        method="highs-ds",
    )
    return scale * solution.x[:-1], float(2 * scale * solution.fun)
