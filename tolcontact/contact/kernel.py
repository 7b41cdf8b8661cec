"""Compiled passes over contact points: no array of size realizations x points is made.

Contact points form leaves of neighbours, and leaves form branches. Bounds of their coordinates bound their gaps.
A leaf or branch that is entirely clear is skipped, one that is entirely active adds its summed moments, and one that cannot
contain the deepest point is left out.
Gaps are summed up in the order of `PairScan.gaps`, so that both give the same to the last bit; moments are summed up in
another order than NumPy's, and agree to rounding.
"""

from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled, inlined

LEAF, BRANCH = 32, 32  # points of a leaf, leaves of a branch
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
def write_factors(basis, columns, X, deviations, factors):  # type: ignore[no-untyped-def]
    """Write the factors (r + k,) of the coordinates in the gaps: [[X_RM, 1] @ basis, deviations[columns]]."""
    entries, size = basis.shape[0] - 1, basis.shape[1]
    for c in range(size):
        factors[c] = basis[entries, c]
    for entry in range(entries):
        for c in range(size):
            factors[c] += X[entry] * basis[entry, c]
    for c in range(columns.size):
        factors[size + c] = deviations[columns[c]]


@inlined
def bounds(boxes, start, count, factors, middle, spread):  # type: ignore[no-untyped-def]
    """Write the gap at the centre of some boxes, and the largest difference from it in each box: middle and spread (count,)."""
    rounding = ROUNDING * abs(factors[0])
    for box in range(count):
        middle[box] = factors[0]
        spread[box] = rounding
    for c in range(1, factors.size):
        slope, size = factors[c], abs(factors[c])
        centres, halves = boxes[0, c - 1, start : start + count], boxes[1, c - 1, start : start + count]
        for box in range(count):
            middle[box] += slope * centres[box]
            spread[box] += size * halves[box]


@inlined
def gaps_of(coordinates, start, count, factors, gaps):  # type: ignore[no-untyped-def]
    """Write the gaps (LEAF,) [mm] of the points `start` to `start + count`."""
    for j in range(count):
        gaps[j] = factors[0]
    for c in range(1, factors.size):
        slope = factors[c]
        row = coordinates[c, start : start + count]
        for j in range(count):
            gaps[j] += slope * row[j]


@compiled
def survey(points, table, leaf_sums, branch_sums, relative, deviations, activity, active, moments):  # type: ignore[no-untyped-def]
    """Write for each realization the number of points below `activity` (n,), and their moments (n, side * 10).

    points        Points
    table         (point, side * moment): what each point adds to the moments
    leaf_sums     (leaf, side * moment), and
    branch_sums   (branch, side * moment): of all points there
    """
    leaves, branches = points.leaves, points.branches
    factors, gaps, found = np.empty(points.coordinates.shape[0]), np.empty(LEAF), np.empty(LEAF, dtype=np.int64)
    middle, spread = np.empty(branches.size - 1), np.empty(branches.size - 1)
    leaf_middle, leaf_spread = np.empty(BRANCH), np.empty(BRANCH)
    for k in range(relative.shape[0]):
        write_factors(points.basis, points.columns, relative[k], deviations[k], factors)
        bounds(points.branch_boxes, 0, middle.size, factors, middle, spread)
        number = 0
        for branch in range(middle.size):
            if middle[branch] - spread[branch] >= activity:
                continue
            first_leaf, end_leaf = branches[branch], branches[branch + 1]
            if middle[branch] + spread[branch] < activity:
                number += leaves[end_leaf] - leaves[first_leaf]
                for moment in range(moments.shape[1]):
                    moments[k, moment] += branch_sums[branch, moment]
                continue
            bounds(points.leaf_boxes, first_leaf, end_leaf - first_leaf, factors, leaf_middle, leaf_spread)
            for leaf in range(first_leaf, end_leaf):
                place = leaf - first_leaf
                if leaf_middle[place] - leaf_spread[place] >= activity:
                    continue
                start, count = leaves[leaf], leaves[leaf + 1] - leaves[leaf]
                if leaf_middle[place] + leaf_spread[place] < activity:
                    number += count
                    for moment in range(moments.shape[1]):
                        moments[k, moment] += leaf_sums[leaf, moment]
                    continue
                gaps_of(points.coordinates, start, count, factors, gaps)
                active_here = 0
                for j in range(count):  # without a branch, since it would be unpredictable
                    found[active_here] = start + j
                    active_here += gaps[j] < activity
                number += active_here
                for j in range(active_here):
                    of_point = table[found[j]]
                    for moment in range(moments.shape[1]):
                        moments[k, moment] += of_point[moment]
        active[k] = number


@inlined
def _deepest_of_leaves(points, first_leaf, end_leaf, factors, may_carry, lowest, where, scratch):  # type: ignore[no-untyped-def]
    """Return gap and index of the deepest point of some leaves, if it is below `lowest`, or as low and before `where`."""
    leaves = points.leaves
    gaps, middle, spread = scratch
    bounds(points.leaf_boxes, first_leaf, end_leaf - first_leaf, factors, middle, spread)
    promising = 0
    for place in range(1, end_leaf - first_leaf):
        if middle[place] - spread[place] < middle[promising] - spread[promising]:
            promising = place
    for turn in range(-1, end_leaf - first_leaf):
        place = promising if turn < 0 else turn
        if turn == promising or middle[place] - spread[place] > lowest:
            continue
        start, count = leaves[first_leaf + place], leaves[first_leaf + place + 1] - leaves[first_leaf + place]
        gaps_of(points.coordinates, start, count, factors, gaps)
        for j in range(count):
            if may_carry.size and not may_carry[start + j]:
                continue
            if gaps[j] < lowest or (gaps[j] == lowest and start + j < where):
                lowest, where = gaps[j], start + j
    return lowest, where


@compiled
def deepest(points, clusters, relative, deviations, may_carry, limit, numbers, gaps_there):  # type: ignore[no-untyped-def]
    """Write index and gap of the deepest point of each cluster (n, cluster), if its gap is less than `limit`.

    Else write the cluster's first point, and `limit`.

    points      Points
    clusters    (cluster + 1,): the first branch of each cluster, and the end
    may_carry   (n, point): the points to look at; all if it is (n, 0)
    """
    leaves, branches = points.leaves, points.branches
    factors = np.empty(points.coordinates.shape[0])
    middle, spread = np.empty(branches.size - 1), np.empty(branches.size - 1)
    scratch = np.empty(LEAF), np.empty(BRANCH), np.empty(BRANCH)
    for k in range(relative.shape[0]):
        write_factors(points.basis, points.columns, relative[k], deviations[k], factors)
        bounds(points.branch_boxes, 0, middle.size, factors, middle, spread)
        for cluster in range(clusters.size - 1):
            begin, end = clusters[cluster], clusters[cluster + 1]
            lowest, where = limit, leaves[branches[begin]]
            promising = begin
            for branch in range(begin + 1, end):
                if middle[branch] - spread[branch] < middle[promising] - spread[promising]:
                    promising = branch
            for turn in range(begin - 1, end):
                branch = promising if turn < begin else turn
                if turn == promising or middle[branch] - spread[branch] > lowest:
                    continue
                lowest, where = _deepest_of_leaves(
                    points, branches[branch], branches[branch + 1], factors, may_carry[k], lowest, where, scratch
                )
            numbers[k, cluster], gaps_there[k, cluster] = where, lowest


@compiled
def count_below(basis, columns, coordinates, relative, deviations, limit, counts):  # type: ignore[no-untyped-def]
    """Add to counts (point,) the number of realizations in which the gap of a point is below `limit`; see GapMap."""
    factors, gaps = np.empty(coordinates.shape[0]), np.empty(LEAF)
    for k in range(relative.shape[0]):
        write_factors(basis, columns, relative[k], deviations[k], factors)
        for start in range(0, coordinates.shape[1], LEAF):
            count = min(LEAF, coordinates.shape[1] - start)
            gaps_of(coordinates, start, count, factors, gaps)
            for j in range(count):
                counts[start + j] += gaps[j] < limit
