"""The narrowest zone that contains a face with form: between two planes, coaxial cylinders, or concentric circles or spheres.

Its width is the least, over displacements of the zone, of the largest distance of heights from its middle, doubled. That is a
linear programme. Its dual has one more point than the zone has freedoms: points are exchanged until none is farther out.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

MAX_EXCHANGES = 200
FARTHER = 1e-9  # of the width: points that are no farther out are in the zone
SHIFT = 1e-8  # of the extent: shifts of points, since exchanges among points in line may cycle
AT_ONCE = 512  # fields
MIN_STEP = 1e-12


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
    widths = np.concatenate([_exchanged(rigid, heights[k : k + AT_ONCE]) for k in range(0, len(heights), AT_ONCE)])
    for row in np.flatnonzero(np.isnan(widths)):
        widths[row] = _by_programme(rigid, heights[row])
    return widths


def _exchanged(rigid: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Return the widths (n,) by exchange; NaN where exchanges do not end."""
    shifted = rigid + SHIFT * np.random.default_rng(0).uniform(-1, 1, rigid.shape) * [0, *[1] * (rigid.shape[1] - 1)]
    count = rigid.shape[1] + 1
    chosen = np.tile(_spread_points(shifted), (len(heights), 1))
    signs = np.ones(chosen.shape)
    widths, remaining = np.full(len(heights), np.nan), np.arange(len(heights))
    weights = np.linalg.svd(shifted[chosen[0]].T)[2][-1]
    signs[:] = np.where(weights < 0, -1.0, 1.0)
    for _ in range(MAX_EXCHANGES):
        columns = np.concatenate(
            [signs[..., None] * shifted[chosen], np.ones((*chosen.shape, 1))], axis=2
        )  # (n, chosen, freedom + 1)
        values = signs * np.take_along_axis(heights[remaining], chosen, axis=1)
        solution = np.linalg.solve(columns, values[..., None])[..., 0]
        residuals = heights[remaining] - solution[:, :-1] @ shifted.T
        entering = np.abs(residuals).argmax(axis=1)
        rows = np.arange(len(remaining))
        largest = residuals[rows, entering]
        done = np.abs(largest) <= solution[:, -1] * (1 + FARTHER) + 1e-300
        widths[remaining[done]] = 2 * np.abs(largest[done])
        remaining, chosen, signs, columns = remaining[~done], chosen[~done], signs[~done], columns[~done]
        if not len(remaining):
            break
        entering, sense = entering[~done], np.sign(largest[~done])
        target = np.concatenate([sense[:, None] * shifted[entering], np.ones((len(remaining), 1))], axis=1)
        weights = np.linalg.solve(columns.swapaxes(1, 2), np.eye(count)[-1][:, None])[..., 0]
        steps = np.linalg.solve(columns.swapaxes(1, 2), target[..., None])[..., 0]
        ratios = np.where(steps > MIN_STEP, np.maximum(weights, 0.0) / np.maximum(steps, MIN_STEP), np.inf)
        leaving, rows = ratios.argmin(axis=1), np.arange(len(remaining))
        chosen[rows, leaving], signs[rows, leaving] = entering, sense
    return widths


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


def _by_programme(rigid: np.ndarray, heights: np.ndarray) -> float:
    """Return the width by a solver of linear programmes."""
    scale, ones = max(float(np.ptp(heights)), 1e-300), np.ones((len(heights), 1))
    solution = scipy.optimize.linprog(
        np.append(np.zeros(rigid.shape[1]), 1.0),
        A_ub=np.block([[rigid, -ones], [-rigid, -ones]]),
        b_ub=np.concatenate([heights, -heights]) / scale,
        bounds=[(None, None)] * rigid.shape[1] + [(0, None)],
        method="highs-ds",
    )
    return float(2 * scale * solution.fun)
