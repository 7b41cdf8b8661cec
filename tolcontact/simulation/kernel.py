"""Passes over the points of a surface, compiled: no array of size realizations x points is made.

Contact points come in leaves of neighbours with bounds of their coordinates, which bound their gaps. A leaf that is wholly
clear is passed over, one that is wholly active adds its summed moments, and one that cannot hold the deepest is left out.
Gaps are summed up in the order of `PairScan.gaps`, so that both give the same to the last bit; moments are summed up in
another order than NumPy's, and agree to rounding.
"""

import numpy as np
from numba import njit

LEAF, LANES, CHUNK = 32, 8, 256
INF = np.inf


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _coefficients(basis, X, of):  # type: ignore[no-untyped-def]
    """Coefficients of the gaps by the coordinates, [X_RM, 1] @ basis, into of (r,)."""
    for c in range(of.size):
        of[c] = basis[12, c]
    for entry in range(12):
        for c in range(of.size):
            of[c] += X[entry] * basis[entry, c]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _bounds(centres, halves, of, middle, reach):  # type: ignore[no-untyped-def]
    """Of each leaf the gap in its middle, and how far gaps can be from that, into middle and reach (leaf,)."""
    for leaf in range(middle.size):
        middle[leaf] = of[0]
        reach[leaf] = 0.0
    for c in range(1, of.size):
        slope = abs(of[c])
        for leaf in range(middle.size):
            middle[leaf] += of[c] * centres[c - 1, leaf]
            reach[leaf] += slope * halves[c - 1, leaf]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _gaps(coordinates, first, count, of, deviations, locators, gaps):  # type: ignore[no-untyped-def]
    """Gaps [mm] of the points `first` to `first + count`, into gaps (LEAF,)."""
    for j in range(count):
        gaps[j] = of[0]
    for c in range(1, of.size):
        slope = of[c]
        row = coordinates[c, first : first + count]
        for j in range(count):
            gaps[j] += slope * row[j]
    if locators.size:
        for j in range(count):
            gaps[j] -= deviations[locators[first + j]]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_moments(table, first, count, counts, lanes, moments):  # type: ignore[no-untyped-def]
    """Add to moments (10,) the columns of `table` (10, point) that count: counts (LEAF,), 1 or 0.

    LANES sums side by side, in a fixed order: a compiler that may choose the order chooses another one another day.
    """
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
def survey(points, tables, sums, relative, deviations, activity, active, moments):  # type: ignore[no-untyped-def]
    """For each realization the number of points below `activity` (n,), and their moments (n, side, 10).

    points      see PairScan: (basis, coordinates, starts of the leaves, centres, halves, locators)
    tables      (side, moment, point)
    sums        (leaf, side, moment): of all points of a leaf
    """
    basis, coordinates, starts, centres, halves, locators = points
    of, gaps, counts, lanes = np.empty(basis.shape[1]), np.empty(LEAF), np.empty(LEAF), np.empty(LANES)
    middle, reach = np.empty(starts.size - 1), np.empty(starts.size - 1)
    for k in range(relative.shape[0]):
        _coefficients(basis, relative[k], of)
        _bounds(centres, halves, of, middle, reach)
        number = 0
        for leaf in range(middle.size):
            if middle[leaf] - reach[leaf] >= activity:
                continue
            first, count = starts[leaf], starts[leaf + 1] - starts[leaf]
            if middle[leaf] + reach[leaf] < activity:
                number += count
                moments[k] += sums[leaf]
                continue
            _gaps(coordinates, first, count, of, deviations[k], locators, gaps)
            below = 0
            for j in range(count):
                is_active = gaps[j] < activity
                below += is_active
                counts[j] = 1.0 if is_active else 0.0
            number += below
            if below:
                for side in range(tables.shape[0]):
                    _add_moments(tables[side], first, count, counts, lanes, moments[k, side])
        active[k] = number


@njit(cache=True, nogil=True, error_model="numpy")
def deepest(points, clusters, relative, deviations, may_carry, numbers, gaps_there):  # type: ignore[no-untyped-def]
    """For each realization the deepest point of each cluster (n, cluster), and its gap; infinite where none may carry.

    points      as in `survey`
    clusters    (cluster + 1,): the first leaf of each cluster, and the end
    may_carry   (n, point), only these points are looked at; all where it is empty
    """
    basis, coordinates, starts, centres, halves, locators = points
    of, gaps = np.empty(basis.shape[1]), np.empty(LEAF)
    middle, reach = np.empty(starts.size - 1), np.empty(starts.size - 1)
    for k in range(relative.shape[0]):
        _coefficients(basis, relative[k], of)
        _bounds(centres, halves, of, middle, reach)
        for cluster in range(clusters.size - 1):
            begin, end = clusters[cluster], clusters[cluster + 1]
            lowest, where = INF, starts[begin]
            promising = begin
            for leaf in range(begin + 1, end):
                if middle[leaf] - reach[leaf] < middle[promising] - reach[promising]:
                    promising = leaf
            for turn in range(begin - 1, end):
                leaf = promising if turn < begin else turn
                if turn == promising or middle[leaf] - reach[leaf] > lowest:
                    continue
                first, count = starts[leaf], starts[leaf + 1] - starts[leaf]
                _gaps(coordinates, first, count, of, deviations[k], locators, gaps)
                for j in range(count):
                    if may_carry.shape[0] and not may_carry[k, first + j]:
                        continue
                    if gaps[j] < lowest or (gaps[j] == lowest and first + j < where):
                        lowest, where = gaps[j], first + j
            numbers[k, cluster], gaps_there[k, cluster] = where, lowest


@njit(cache=True, nogil=True, error_model="numpy")
def add_magnitudes(A, points, shift, powers):  # type: ignore[no-untyped-def]
    """Add to powers (4, point) the first to fourth power of |u| - shift, realization after realization.

    u = A @ (x, y, z, 1) for A (n, 3, 4), points (3, point), shift (point,).
    """
    for first in range(0, shift.size, CHUNK):
        last = min(first + CHUNK, shift.size)
        x, y, z, less = points[0, first:last], points[1, first:last], points[2, first:last], shift[first:last]
        sum1, sum2, sum3, sum4 = powers[0, first:last], powers[1, first:last], powers[2, first:last], powers[3, first:last]
        for k in range(A.shape[0]):
            a, b, c = A[k, 0], A[k, 1], A[k, 2]
            for v in range(x.size):
                u = a[0] * x[v] + a[1] * y[v] + a[2] * z[v] + a[3]
                w = b[0] * x[v] + b[1] * y[v] + b[2] * z[v] + b[3]
                t = c[0] * x[v] + c[1] * y[v] + c[2] * z[v] + c[3]
                one = np.sqrt(u * u + w * w + t * t) - less[v]
                two = one * one
                sum1[v] += one
                sum2[v] += two
                sum3[v] += two * one
                sum4[v] += two * two
