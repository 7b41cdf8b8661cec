"""Passes over the points of a surface, compiled: no array of size realizations x points is made.

Contact points come in leaves of neighbours, and those in branches, with bounds of their coordinates, which bound their gaps.
What is wholly clear is passed over, what is wholly active adds its summed moments, what cannot hold the deepest is left out.
Gaps are summed up in the order of `PairScan.gaps`, so that both give the same to the last bit; moments are summed up in
another order than NumPy's, and agree to rounding.
"""

import functools
from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled

inlined = functools.partial(compiled, inline=True)

LEAF, BRANCH = 32, 32  # points of a leaf, leaves of a branch
SUMS = 8  # side by side
ROUNDING = 1e-14  # of the gap in the origin of the coordinates: sums of a dozen terms are rounded by less


class Points(NamedTuple):
    """The contact points of a pair, as PairScan has them (see there), and the boxes of its leaves and branches.

    leaf_boxes, branch_boxes    (2, coordinate, box): centres and half widths of the coordinates, without the first one
    """

    basis: np.ndarray
    columns: np.ndarray
    coordinates: np.ndarray
    leaves: np.ndarray
    branches: np.ndarray
    leaf_boxes: np.ndarray
    branch_boxes: np.ndarray


@inlined
def _coefficients(basis, columns, X, deviations, of):  # type: ignore[no-untyped-def]
    """Coefficients of the gaps by the coordinates, [[X_RM, 1] @ basis, deviations[columns]], into of (r + k,)."""
    entries, size = basis.shape[0] - 1, basis.shape[1]
    for c in range(size):
        of[c] = basis[entries, c]
    for entry in range(entries):
        for c in range(size):
            of[c] += X[entry] * basis[entry, c]
    for c in range(columns.size):
        of[size + c] = deviations[columns[c]]


@inlined
def _bounds(boxes, first, count, of, middle, reach):  # type: ignore[no-untyped-def]
    """Of some boxes the gap in their middle, and how far gaps can be from that, into middle and reach (count,)."""
    least = ROUNDING * abs(of[0])
    for box in range(count):
        middle[box] = of[0]
        reach[box] = least
    for c in range(1, of.size):
        slope, size = of[c], abs(of[c])
        centres, halves = boxes[0, c - 1, first : first + count], boxes[1, c - 1, first : first + count]
        for box in range(count):
            middle[box] += slope * centres[box]
            reach[box] += size * halves[box]


@inlined
def _gaps(coordinates, first, count, of, gaps):  # type: ignore[no-untyped-def]
    """Gaps [mm] of the points `first` to `first + count`, into gaps (LEAF,)."""
    for j in range(count):
        gaps[j] = of[0]
    for c in range(1, of.size):
        slope = of[c]
        row = coordinates[c, first : first + count]
        for j in range(count):
            gaps[j] += slope * row[j]


@compiled
def _add_moments(table, first, count, counts, lanes, moments):  # type: ignore[no-untyped-def]
    """Add to moments (m,) the columns of `table` (m, point) that count: counts (LEAF,), 1 or 0.

    SUMS side by side, in a fixed order: a compiler that may choose the order chooses another one another day.
    """
    whole = count - count % SUMS
    for moment in range(table.shape[0]):
        row = table[moment, first : first + count]
        for lane in range(SUMS):
            lanes[lane] = 0.0
        for j in range(0, whole, SUMS):
            for lane in range(SUMS):
                lanes[lane] += counts[j + lane] * row[j + lane]
        total = 0.0
        for lane in range(SUMS):
            total += lanes[lane]
        for j in range(whole, count):
            total += counts[j] * row[j]
        moments[moment] += total


@compiled
def survey(points, tables, leaf_sums, branch_sums, relative, deviations, activity, active, moments):  # type: ignore[no-untyped-def]
    """For each realization the number of points below `activity` (n,), and their moments (n, side * 10).

    points        Points
    tables        (side * moment, point)
    leaf_sums     (leaf, side * moment), and
    branch_sums   (branch, side * moment): of all points there
    """
    leaves, branches = points.leaves, points.branches
    of, gaps, counts, lanes = np.empty(points.coordinates.shape[0]), np.empty(LEAF), np.empty(LEAF), np.empty(SUMS)
    middle, reach = np.empty(branches.size - 1), np.empty(branches.size - 1)
    middle_here, reach_here = np.empty(BRANCH), np.empty(BRANCH)
    for k in range(relative.shape[0]):
        _coefficients(points.basis, points.columns, relative[k], deviations[k], of)
        _bounds(points.branch_boxes, 0, middle.size, of, middle, reach)
        number = 0
        for branch in range(middle.size):
            if middle[branch] - reach[branch] >= activity:
                continue
            first_leaf, end_leaf = branches[branch], branches[branch + 1]
            if middle[branch] + reach[branch] < activity:
                number += leaves[end_leaf] - leaves[first_leaf]
                for moment in range(moments.shape[1]):
                    moments[k, moment] += branch_sums[branch, moment]
                continue
            _bounds(points.leaf_boxes, first_leaf, end_leaf - first_leaf, of, middle_here, reach_here)
            for leaf in range(first_leaf, end_leaf):
                here = leaf - first_leaf
                if middle_here[here] - reach_here[here] >= activity:
                    continue
                first, count = leaves[leaf], leaves[leaf + 1] - leaves[leaf]
                if middle_here[here] + reach_here[here] < activity:
                    number += count
                    for moment in range(moments.shape[1]):
                        moments[k, moment] += leaf_sums[leaf, moment]
                    continue
                _gaps(points.coordinates, first, count, of, gaps)
                below = 0
                for j in range(count):
                    is_active = gaps[j] < activity
                    below += is_active
                    counts[j] = 1.0 if is_active else 0.0
                number += below
                if below:
                    _add_moments(tables, first, count, counts, lanes, moments[k])
        active[k] = number


@inlined
def _deepest_of_leaves(points, first_leaf, end_leaf, of, may_carry, lowest, where, scratch):  # type: ignore[no-untyped-def]
    """The deepest point of some leaves, if it is below `lowest` or as low and before `where`; its gap and number."""
    leaves = points.leaves
    gaps, middle, reach = scratch
    _bounds(points.leaf_boxes, first_leaf, end_leaf - first_leaf, of, middle, reach)
    promising = 0
    for here in range(1, end_leaf - first_leaf):
        if middle[here] - reach[here] < middle[promising] - reach[promising]:
            promising = here
    for turn in range(-1, end_leaf - first_leaf):
        here = promising if turn < 0 else turn
        if turn == promising or middle[here] - reach[here] > lowest:
            continue
        first, count = leaves[first_leaf + here], leaves[first_leaf + here + 1] - leaves[first_leaf + here]
        _gaps(points.coordinates, first, count, of, gaps)
        for j in range(count):
            if may_carry.size and not may_carry[first + j]:
                continue
            if gaps[j] < lowest or (gaps[j] == lowest and first + j < where):
                lowest, where = gaps[j], first + j
    return lowest, where


@compiled
def deepest(points, clusters, relative, deviations, may_carry, below, numbers, gaps_there):  # type: ignore[no-untyped-def]
    """For each realization the deepest point of each cluster (n, cluster), and its gap, if that is less than `below`.

    Else they are the cluster's first point, and `below`.

    points      Points
    clusters    (cluster + 1,): the first branch of each cluster, and the end
    may_carry   (n, point), only these points are considered; all if it is (n, 0)
    """
    leaves, branches = points.leaves, points.branches
    of = np.empty(points.coordinates.shape[0])
    middle, reach = np.empty(branches.size - 1), np.empty(branches.size - 1)
    scratch = np.empty(LEAF), np.empty(BRANCH), np.empty(BRANCH)
    for k in range(relative.shape[0]):
        _coefficients(points.basis, points.columns, relative[k], deviations[k], of)
        _bounds(points.branch_boxes, 0, middle.size, of, middle, reach)
        for cluster in range(clusters.size - 1):
            begin, end = clusters[cluster], clusters[cluster + 1]
            lowest, where = below, leaves[branches[begin]]
            promising = begin
            for branch in range(begin + 1, end):
                if middle[branch] - reach[branch] < middle[promising] - reach[promising]:
                    promising = branch
            for turn in range(begin - 1, end):
                branch = promising if turn < begin else turn
                if turn == promising or middle[branch] - reach[branch] > lowest:
                    continue
                lowest, where = _deepest_of_leaves(
                    points, branches[branch], branches[branch + 1], of, may_carry[k], lowest, where, scratch
                )
            numbers[k, cluster], gaps_there[k, cluster] = where, lowest


@compiled
def count_below(basis, columns, coordinates, relative, deviations, limit, counts):  # type: ignore[no-untyped-def]
    """Add to counts (point,) the number of realizations in which the gap of a point is below `limit`; see GapMap."""
    of, gaps = np.empty(coordinates.shape[0]), np.empty(LEAF)
    for k in range(relative.shape[0]):
        _coefficients(basis, columns, relative[k], deviations[k], of)
        for first in range(0, coordinates.shape[1], LEAF):
            count = min(LEAF, coordinates.shape[1] - first)
            _gaps(coordinates, first, count, of, gaps)
            for j in range(count):
                counts[first + j] += gaps[j] < limit
