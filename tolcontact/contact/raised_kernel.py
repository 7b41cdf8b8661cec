"""Compiled passes over contact points of faces with form, whose heights are summed up once for each realization."""

import numpy as np

from tolcontact.compiled import compiled
from tolcontact.contact.kernel import LEAF, bounds, gaps_of, write_factors


@compiled
def sum_heights(columns, slopes, leaves, deviations, raised, lowest):  # type: ignore[no-untyped-def]
    """Write sums (n, point) of slopes (k, point) times deviations[columns], and the least (n, leaf) of each leaf."""
    for k in range(deviations.shape[0]):
        raised[k] = 0.0
        for c in range(columns.size):
            factor, row = deviations[k, columns[c]], slopes[c]
            for j in range(row.size):
                raised[k, j] += factor * row[j]
        for leaf in range(leaves.size - 1):
            low = raised[k, leaves[leaf]]
            for j in range(leaves[leaf] + 1, leaves[leaf + 1]):
                low = min(low, raised[k, j])
            lowest[k, leaf] = low


@compiled
def gather(P_m, P_r, n_r, raised, numbers, points, out_m, out_r, out_n):  # type: ignore[no-untyped-def]
    """Write P_m, P_r and n_r (n, slot, 3) of `points` (n, slot), P_r raised along the normals."""
    for k in range(points.shape[0]):
        for slot in range(points.shape[1]):
            point = points[k, slot]
            height = -raised[numbers[k], point]
            for axis in range(3):
                normal = n_r[point, axis]
                out_m[k, slot, axis], out_n[k, slot, axis] = P_m[point, axis], normal
                out_r[k, slot, axis] = P_r[point, axis] + height * normal


@compiled
def deepest(points, clusters, relative, raised, lowest, numbers, may_carry, limit, points_there, gaps_there):  # type: ignore[no-untyped-def]
    """Write index and gap of the deepest point of each cluster (n, cluster), if its gap is less than `limit`.

    Else write the cluster's first point, and `limit`.

    points      Points
    clusters    (cluster + 1,): the first leaf of each cluster, and the end
    raised      (m, point), and lowest (m, leaf): see RaisedScan, for realizations with `numbers` (n,)
    may_carry   (n, point): the points to look at; all if it is (n, 0)
    """
    leaves, nothing = points.leaves, np.empty(0, dtype=np.int64)
    factors = np.empty(points.basis.shape[1])
    middle, spread, gaps = np.empty(leaves.size - 1), np.empty(leaves.size - 1), np.empty(LEAF)
    for k in range(relative.shape[0]):
        write_factors(points.basis, nothing, relative[k], relative[k], factors)
        bounds(points.leaf_boxes, 0, middle.size, factors, middle, spread)
        row = numbers[k]
        for leaf in range(middle.size):
            middle[leaf] += lowest[row, leaf] - spread[leaf]
        for cluster in range(clusters.size - 1):
            begin, end = clusters[cluster], clusters[cluster + 1]
            deepest_gap, where = limit, leaves[begin]
            promising = begin
            for leaf in range(begin + 1, end):
                if middle[leaf] < middle[promising]:
                    promising = leaf
            for turn in range(begin - 1, end):
                leaf = promising if turn < begin else turn
                if turn == promising or middle[leaf] > deepest_gap:
                    continue
                start, count = leaves[leaf], leaves[leaf + 1] - leaves[leaf]
                gaps_of(points.coordinates, start, count, factors, gaps)
                for j in range(count):
                    if may_carry.size and not may_carry[k, start + j]:
                        continue
                    gap = gaps[j] + raised[row, start + j]
                    if gap < deepest_gap or (gap == deepest_gap and start + j < where):
                        deepest_gap, where = gap, start + j
            points_there[k, cluster], gaps_there[k, cluster] = where, deepest_gap


@compiled
def write_low_gaps(points, relative, raised, lowest, numbers, limits, values):  # type: ignore[no-untyped-def]
    """Write the gaps (n, point) of the leaves that may hold gaps below `limits` (n,); infinite ones of other leaves.

    points      Points
    raised      (m, point), and lowest (m, leaf): see RaisedScan, for realizations with `numbers` (n,)
    """
    leaves, nothing = points.leaves, np.empty(0, dtype=np.int64)
    factors = np.empty(points.basis.shape[1])
    middle, spread, gaps = np.empty(leaves.size - 1), np.empty(leaves.size - 1), np.empty(LEAF)
    for k in range(relative.shape[0]):
        write_factors(points.basis, nothing, relative[k], relative[k], factors)
        bounds(points.leaf_boxes, 0, middle.size, factors, middle, spread)
        row = numbers[k]
        for leaf in range(middle.size):
            start, count = leaves[leaf], leaves[leaf + 1] - leaves[leaf]
            is_clear = middle[leaf] + lowest[row, leaf] - spread[leaf] > limits[k]
            if not is_clear:
                gaps_of(points.coordinates, start, count, factors, gaps)
            for j in range(count):
                values[k, start + j] = np.inf if is_clear else gaps[j] + raised[row, start + j]
