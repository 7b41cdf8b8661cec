"""Passes over the contact constants of a pair, compiled: no array of size realizations x points is made.

Gaps are summed up in the order of `PairScan.gaps`, so that both give the same to the last bit; moments are summed up in
another order than NumPy's, and agree to rounding.
"""

import numpy as np
from numba import njit

CHUNK, LANES = 256, 8
INF = np.inf


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _gaps(matrix, first, count, X, deviations, locators, gaps):  # type: ignore[no-untyped-def]
    """Gaps [mm] of the points `first` to `first + count` at X_RM (12,), into gaps (CHUNK,)."""
    for j in range(count):
        gaps[j] = matrix[12, first + j]
    for entry in range(12):
        x = X[entry]
        row = matrix[entry, first : first + count]
        for j in range(count):
            gaps[j] += x * row[j]
    if locators.size:
        for j in range(count):
            gaps[j] -= deviations[locators[first + j]]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_moments(table, first, count, gaps, activity, counts, lanes, moments):  # type: ignore[no-untyped-def]
    """Add to moments (10,) the columns of `table` (10, point) whose points are active.

    LANES sums side by side, in a fixed order: a compiler that may choose the order chooses another one another day.
    """
    for j in range(count):
        counts[j] = 1.0 if gaps[j] < activity else 0.0
    whole = count - count % LANES
    for moment in range(table.shape[0]):
        row = table[moment, first : first + count]
        for lane in range(LANES):
            lanes[lane] = 0.0
        for j in range(0, whole, LANES):
            for lane in range(LANES):
                lanes[lane] += counts[j + lane] * row[j + lane]
        total = 0.0
        for lane in range(LANES):
            total += lanes[lane]
        for j in range(whole, count):
            total += counts[j] * row[j]
        moments[moment] += total


@njit(cache=True, nogil=True, error_model="numpy")
def survey(matrix, tables, relative, deviations, locators, activity, least, active, moments):  # type: ignore[no-untyped-def]
    """For each realization the least gap (n,), the number of points below `activity` (n,), and their moments (n, side, 10)."""
    gaps, counts, lanes = np.empty(CHUNK), np.empty(CHUNK), np.empty(LANES)
    for k in range(relative.shape[0]):
        lowest, number = INF, 0
        for first in range(0, matrix.shape[1], CHUNK):
            count = min(CHUNK, matrix.shape[1] - first)
            _gaps(matrix, first, count, relative[k], deviations[k], locators, gaps)
            below = 0
            for j in range(count):
                lowest = min(lowest, gaps[j])
                below += gaps[j] < activity
            if below:
                for side in range(tables.shape[0]):
                    _add_moments(tables[side], first, count, gaps, activity, counts, lanes, moments[k, side])
            number += below
        least[k], active[k] = lowest, number


@njit(cache=True, nogil=True, error_model="numpy")
def deepest(matrix, starts, relative, deviations, locators, may_carry, points, gaps_there):  # type: ignore[no-untyped-def]
    """For each realization the deepest point of each cluster (n, cluster), and its gap; infinite where none may carry.

    Only points where may_carry (n, point) holds are looked at; all where it is empty.
    """
    gaps = np.empty(CHUNK)
    for k in range(relative.shape[0]):
        for cluster in range(starts.size - 1):
            lowest, where = INF, starts[cluster]
            for first in range(starts[cluster], starts[cluster + 1], CHUNK):
                count = min(CHUNK, starts[cluster + 1] - first)
                _gaps(matrix, first, count, relative[k], deviations[k], locators, gaps)
                if may_carry.shape[0]:
                    for j in range(count):
                        if not may_carry[k, first + j]:
                            gaps[j] = INF
                for j in range(count):
                    if gaps[j] < lowest:
                        lowest, where = gaps[j], first + j
            points[k, cluster], gaps_there[k, cluster] = where, lowest
