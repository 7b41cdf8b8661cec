"""Compiled search for the lowest points of flat faces over each other."""

from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled, inner


class Region(NamedTuple):
    """A flat face, seen along its normal.

    axes        (2, 3) unit vectors in its plane
    edges       (edge, 2, 2) [mm]: ends of the edges of its rim along these
    tolerance   [mm]: largest distance outside the rim at which a point counts as over the face
    """

    axes: np.ndarray
    edges: np.ndarray
    tolerance: float


@compiled
def plane_gaps(X_RM, P_m, P_r, n_r, gaps):  # type: ignore[no-untyped-def]
    """Write gaps n_r (R P_m + t - P_r) of points (point, 3) at X_RM (n, 12) to the first columns of `gaps`."""
    for k in range(X_RM.shape[0]):
        X = X_RM[k]
        for j in range(P_m.shape[0]):
            gap = 0.0
            for i in range(3):
                x = X[3 * i] * P_m[j, 0] + X[3 * i + 1] * P_m[j, 1] + X[3 * i + 2] * P_m[j, 2] + X[9 + i] - P_r[j, i]
                gap += x * n_r[j, i]
            gaps[k, j] = gap


@compiled
def write_promising(X_RM, P_m, rim, gaps, bounds, groups, reference, moving, retained, promising):  # type: ignore[no-untyped-def]
    """Write which points may be the lowest of their group over the other face, or are retained; see lowest_over.

    bounds      (n, 2) [mm]: error bounds of the gaps of points of the moving face and of the rim; with 0, points are skipped
    retained    (n, k): indices of retained points, -1 for none
    """
    count = P_m.shape[0]
    for k in range(gaps.shape[0]):
        for group in range(groups.size - 1):
            first, end = groups[group], groups[group + 1]
            least_gap = np.inf
            for j in range(first, end):
                highest = gaps[k, j] + bounds[k, 0 if j < count else 1]
                if highest < least_gap and stands_over(X_RM[k], P_m, rim[k], j, reference, moving):
                    least_gap = highest
            for j in range(first, end):
                bound = bounds[k, 0 if j < count else 1]
                promising[k, j] = bound > 0 and gaps[k, j] - bound <= least_gap < np.inf
        for c in range(retained.shape[1]):
            index = retained[k, c]
            if index >= 0 and bounds[k, 0 if index < count else 1] > 0:
                promising[k, index] = True


@compiled
def leave_low(X_RM, P_m, rim, gaps, limits, reference, moving):  # type: ignore[no-untyped-def]
    """Replace gaps (n, point) by infinity unless they are below `limits` (n,) and their points are over the other face."""
    for k in range(gaps.shape[0]):
        for j in range(gaps.shape[1]):
            if gaps[k, j] >= limits[k] or not stands_over(X_RM[k], P_m, rim[k], j, reference, moving):
                gaps[k, j] = np.inf


@compiled
def lowest_over(X_RM, P_m, rim, gaps, groups, reference, moving, indices):  # type: ignore[no-untyped-def]
    """Write the index of the point with the smallest gap over the other face, by group, to indices (n, group); -1 for none.

    P_m         (point, 3) of the moving face, which must be over the reference region at X_RM (n, 12)
    rim         (n, rim point, 3) of the plane of the moving face, which must be over the moving region
    gaps        (n, point) [mm] of both
    groups      (group + 1,) the first point of each, and the end
    """
    for k in range(X_RM.shape[0]):
        for group in range(groups.size - 1):
            least_gap, index = np.inf, -1
            for j in range(groups[group], groups[group + 1]):
                if gaps[k, j] < least_gap and stands_over(X_RM[k], P_m, rim[k], j, reference, moving):
                    least_gap, index = gaps[k, j], j
            indices[k, group] = index


@compiled
def keep_over(X_RM, P_m, rim, reference, moving, indices):  # type: ignore[no-untyped-def]
    """Replace indices of points (n, k) that are not over the other face by -1; see lowest_over."""
    for k in range(X_RM.shape[0]):
        for c in range(indices.shape[1]):
            if indices[k, c] >= 0 and not stands_over(X_RM[k], P_m, rim[k], indices[k, c], reference, moving):
                indices[k, c] = -1


@inner
def stands_over(X, P_m, rim, index, reference, moving):  # type: ignore[no-untyped-def]
    """Return whether a point is over the other face at a pose X (12,)."""
    count = P_m.shape[0]
    if index >= count:
        p = rim[index - count]
        return contains(moving, p[0], p[1], p[2])
    x, y, z = P_m[index, 0], P_m[index, 1], P_m[index, 2]
    return contains(
        reference,
        X[0] * x + X[1] * y + X[2] * z + X[9],
        X[3] * x + X[4] * y + X[5] * z + X[10],
        X[6] * x + X[7] * y + X[8] * z + X[11],
    )


@inner
def contains(region, x, y, z):  # type: ignore[no-untyped-def]
    """Return whether a point is over a region, or outside its rim by no more than its tolerance."""
    axes, edges = region.axes, region.edges
    u, v = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z, axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z
    is_inside = False
    for e in range(edges.shape[0]):
        start_height, end_height = edges[e, 0, 1] - v, edges[e, 1, 1] - v
        if (start_height > 0) != (end_height > 0):  # the edge crosses the line through the point along the first axis
            crossing = edges[e, 0, 0] + (edges[e, 1, 0] - edges[e, 0, 0]) * start_height / (start_height - end_height)
            is_inside = is_inside != (crossing > u)
    return is_inside or is_near(edges, u, v, region.tolerance)


@inner
def is_near(edges, u, v, distance):  # type: ignore[no-untyped-def]
    """Return whether a point is within a distance of one of the edges (edge, 2, 2)."""
    for e in range(edges.shape[0]):
        a, b = u - edges[e, 0, 0], v - edges[e, 0, 1]
        along, across = edges[e, 1, 0] - edges[e, 0, 0], edges[e, 1, 1] - edges[e, 0, 1]
        share = min(max((a * along + b * across) / max(along * along + across * across, 1e-300), 0.0), 1.0)
        if (a - share * along) ** 2 + (b - share * across) ** 2 <= distance * distance:
            return True
    return False
