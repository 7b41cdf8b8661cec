"""Compiled passes over contact points: no array of size realizations x points is made.

Contact points form leaves of neighbours, and leaves form branches. Bounds of their coordinates bound their gaps.
A leaf or branch that is entirely clear is skipped, one that is entirely active adds its summed moments, and one that cannot
contain the deepest point is left out.
Gaps are summed up coordinate by coordinate. Heights of faces with form are summed up once for each realization, not in every
pass, and are then added.
"""

from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled, inlined

LEAF, BRANCH = 32, 32  # points of a leaf, leaves of a branch
ROUNDING = 1e-14  # of the gap in the origin of the coordinates: sums of a dozen terms are rounded by less


class Points(NamedTuple):
    """The contact points of a pair, as FixedScan has them (see there), and the boxes of its leaves and branches.

    leaf_boxes, branch_boxes    (2, coordinate, box): centres and half widths of the coordinates, without the first one
    """

    basis: np.ndarray
    columns: np.ndarray
    coordinates: np.ndarray
    leaves: np.ndarray
    branches: np.ndarray
    leaf_boxes: np.ndarray
    branch_boxes: np.ndarray


class Raised(NamedTuple):
    """Heights of the points of m realizations; without realizations no heights are known.

    points      (m, point) [mm]: added to the gaps of nominal faces, below 0 where faces are raised
    leaves      (m, leaf) [mm], and
    branches    (m, branch) [mm]: the least of these
    rows        (n,): indices of the realizations of a pass among the m
    """

    points: np.ndarray
    leaves: np.ndarray
    branches: np.ndarray
    rows: np.ndarray


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
def _deepest_of_leaves(points, raised, k, first_leaf, end_leaf, factors, may_carry, lowest, where, scratch):  # type: ignore[no-untyped-def]
    """Return gap and index of the deepest point of some leaves, if it is below `lowest`, or as low and before `where`."""
    leaves, is_raised = points.leaves, raised.rows.size > 0
    row = raised.rows[k] if is_raised else 0
    gaps, middle, spread = scratch
    bounds(points.leaf_boxes, first_leaf, end_leaf - first_leaf, factors, middle, spread)
    if is_raised:
        for place in range(end_leaf - first_leaf):
            middle[place] += raised.leaves[row, first_leaf + place]
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
            gap = gaps[j] + raised.points[row, start + j] if is_raised else gaps[j]
            if gap < lowest or (gap == lowest and start + j < where):
                lowest, where = gap, start + j
    return lowest, where


@compiled
def deepest(points, raised, relative, deviations, clusters, may_carry, limit, numbers, gaps_there):  # type: ignore[no-untyped-def]
    """Write index and gap of the deepest point of each cluster (n, cluster), if its gap is less than `limit`.

    Else write the cluster's first point, and `limit`.

    points, raised   Points, and Raised
    clusters         (cluster + 1,): the first branch of each cluster, and the end
    may_carry        (n, point): the points to look at; all if it is (n, 0)
    """
    leaves, branches = points.leaves, points.branches
    factors = np.empty(points.coordinates.shape[0])
    middle, spread = np.empty(branches.size - 1), np.empty(branches.size - 1)
    scratch = np.empty(LEAF), np.empty(BRANCH), np.empty(BRANCH)
    for k in range(relative.shape[0]):
        write_factors(points.basis, points.columns, relative[k], deviations[k], factors)
        bounds(points.branch_boxes, 0, middle.size, factors, middle, spread)
        if raised.rows.size:
            for branch in range(middle.size):
                middle[branch] += raised.branches[raised.rows[k], branch]
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
                first_leaf, end_leaf = branches[branch], branches[branch + 1]
                lowest, where = _deepest_of_leaves(
                    points, raised, k, first_leaf, end_leaf, factors, may_carry[k], lowest, where, scratch
                )
            numbers[k, cluster], gaps_there[k, cluster] = where, lowest


@compiled
def write_gaps(points, raised, relative, deviations, limits, values):  # type: ignore[no-untyped-def]
    """Write the gaps (n, point) of the leaves that may hold gaps below `limits` (n,); infinite ones of other leaves."""
    leaves, factors = points.leaves, np.empty(points.coordinates.shape[0])
    middle, spread, gaps = np.empty(leaves.size - 1), np.empty(leaves.size - 1), np.empty(LEAF)
    for k in range(relative.shape[0]):
        write_factors(points.basis, points.columns, relative[k], deviations[k], factors)
        bounds(points.leaf_boxes, 0, middle.size, factors, middle, spread)
        row = raised.rows[k] if raised.rows.size else -1
        for leaf in range(middle.size):
            start, count = leaves[leaf], leaves[leaf + 1] - leaves[leaf]
            lowest = raised.leaves[row, leaf] if row >= 0 else 0.0
            is_clear = middle[leaf] + lowest - spread[leaf] > limits[k]
            if not is_clear:
                gaps_of(points.coordinates, start, count, factors, gaps)
            for j in range(count):
                height = raised.points[row, start + j] if row >= 0 else 0.0
                values[k, start + j] = np.inf if is_clear else gaps[j] + height


@compiled
def sum_heights(columns, slopes, leaves, branches, deviations, raised):  # type: ignore[no-untyped-def]
    """Write sums of slopes (k, point) times deviations[columns] (n, k), and the least of each leaf and branch; see Raised."""
    for k in range(deviations.shape[0]):
        sums, lowest = raised.points[k], raised.leaves[k]
        sums[:] = 0.0
        for c in range(columns.size):
            factor, row = deviations[k, columns[c]], slopes[c]
            for j in range(row.size):
                sums[j] += factor * row[j]
        for leaf in range(leaves.size - 1):
            lowest[leaf] = sums[leaves[leaf] : leaves[leaf + 1]].min()
        for branch in range(branches.size - 1):
            raised.branches[k, branch] = lowest[branches[branch] : branches[branch + 1]].min()


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
