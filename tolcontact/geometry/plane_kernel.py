"""Compiled gaps of flat faces over each other: their lowest points, and the form deviations of planes from spline tables."""

import math
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


class HeightTable(NamedTuple):
    """The form modes of a plane, as cubic B-splines over a square grid; without nodes the plane has no form deviation.

    low           (2,) [mm]: the coordinates at which the first interval between nodes begins
    step          [mm] between nodes
    coefficients  (node along the first axis, node along the second axis, mode), with one additional node on each side
    """

    low: np.ndarray
    step: float
    coefficients: np.ndarray


class Plane(NamedTuple):
    """A flat face in its own coordinates.

    origin   (3,) [mm]
    axes     (2, 3) unit vectors in the plane, and
    normal   (3,) out of the material
    edges    (edge, 7) [mm] of its rim: start (2,), unit direction (2,), length, and unit vector into the face (2,)
    corners  (2, 2) [mm]: smallest and largest coordinates
    table    of its form deviation
    """

    origin: np.ndarray
    axes: np.ndarray
    normal: np.ndarray
    edges: np.ndarray
    corners: np.ndarray
    table: HeightTable


@inner
def _weights(x, values, slopes, bends):  # type: ignore[no-untyped-def]
    """Write the weights (4,) of four neighbouring coefficients at a share x of an interval, and their first two derivatives."""
    y = 1 - x
    values[0], values[3] = y * y * y / 6, x * x * x / 6
    values[1], values[2] = 2 / 3 - x * x * (2 - x) / 2, 2 / 3 - y * y * (2 - y) / 2
    slopes[0], slopes[3] = -y * y / 2, x * x / 2
    slopes[1], slopes[2] = x * (1.5 * x - 2), -y * (1.5 * y - 2)
    bends[0], bends[1], bends[2], bends[3] = y, 3 * x - 2, 3 * y - 2, x


class HeightSums(NamedTuple):
    """Factors of the modes of a plane, and sums of the modes at the nodes of its table, computed on demand.

    factors   (realization, mode)
    values    (node along the first axis, node along the second axis) [mm]
    rows      of the same shape: the realization of each sum, -1 for none
    """

    factors: np.ndarray
    values: np.ndarray
    rows: np.ndarray

    @classmethod
    def of(cls, table: HeightTable, factors: np.ndarray) -> "HeightSums":
        """Return factors with empty sums."""
        nodes = table.coefficients.shape[:2]
        return cls(factors, np.empty(nodes), np.full(nodes, -1))


@inner
def _sum(factors, node):  # type: ignore[no-untyped-def]
    """Return the sum of factors (mode,) times coefficients (mode,), as four independent sums that can run in parallel."""
    first, second, third, fourth, whole = 0.0, 0.0, 0.0, 0.0, factors.size // 4 * 4
    for k in range(0, whole, 4):
        first, second = first + factors[k] * node[k], second + factors[k + 1] * node[k + 1]
        third, fourth = third + factors[k + 2] * node[k + 2], fourth + factors[k + 3] * node[k + 3]
    for k in range(whole, factors.size):
        first += factors[k] * node[k]
    return (first + second) + (third + fourth)


@inner
def height(table, sums, row, u, v, weights):  # type: ignore[no-untyped-def]
    """Return the form deviation [mm] of a realization at coordinates u, v, and its derivatives by u, v, uu, uv, vv.

    weights   (6, 4): work array for the weights of nodes
    """
    nodes, factors, values, rows = table.coefficients, sums.factors, sums.values, sums.rows
    if nodes.shape[0] == 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    x, y = (u - table.low[0]) / table.step, (v - table.low[1]) / table.step
    i, j = min(max(math.floor(x), 0), nodes.shape[0] - 4), min(max(math.floor(y), 0), nodes.shape[1] - 4)
    _weights(x - i, weights[0], weights[1], weights[2])
    _weights(y - j, weights[3], weights[4], weights[5])
    h, h_u, h_v, h_uu, h_uv, h_vv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(4):
        along, along_v, along_vv = 0.0, 0.0, 0.0
        for b in range(4):
            if rows[i + a, j + b] != row:
                values[i + a, j + b], rows[i + a, j + b] = _sum(factors[row], nodes[i + a, j + b]), row
            value = values[i + a, j + b]
            along, along_v = along + weights[3, b] * value, along_v + weights[4, b] * value
            along_vv += weights[5, b] * value
        h, h_u, h_uu = h + weights[0, a] * along, h_u + weights[1, a] * along, h_uu + weights[2, a] * along
        h_v, h_uv, h_vv = h_v + weights[0, a] * along_v, h_uv + weights[1, a] * along_v, h_vv + weights[0, a] * along_vv
    s = 1 / table.step
    return h, s * h_u, s * h_v, s * s * h_uu, s * s * h_uv, s * s * h_vv


@inner
def write_map(moving, reference, X, along):  # type: ignore[no-untyped-def]
    """Write the affine map from coordinates u, v of the moving plane to their projection on the reference plane and the gap.

    along   (3, 3): rows of two coordinates [mm] and the nominal gap [mm], each a factor of u, a factor of v and a constant
    """
    for axis in range(3):
        for i in range(3):
            if axis < 2:
                x, y, z = moving.axes[axis, 0], moving.axes[axis, 1], moving.axes[axis, 2]
            else:
                x, y, z = moving.origin[0], moving.origin[1], moving.origin[2]
            value = X[3 * i] * x + X[3 * i + 1] * y + X[3 * i + 2] * z
            if axis == 2:
                value += X[9 + i] - reference.origin[i]
            for row in range(3):
                vector = reference.axes[row] if row < 2 else reference.normal
                if i == 0:
                    along[row, axis] = 0.0
                along[row, axis] += value * vector[i]


@inner
def gap_at(moving, reference, sums_m, sums_r, row, along, u, v, weights, scratch):  # type: ignore[no-untyped-def]
    """Return the gap [mm] at coordinates of the moving plane; write its derivatives by u, v, uu, uv, vv to scratch (5,)."""
    h, h_u, h_v, h_uu, h_uv, h_vv = height(moving.table, sums_m, row, u, v, weights)
    a, b, c, d = along[0, 0], along[0, 1], along[1, 0], along[1, 1]
    x, y = a * u + b * v + along[0, 2], c * u + d * v + along[1, 2]
    r, r_x, r_y, r_xx, r_xy, r_yy = height(reference.table, sums_r, row, x, y, weights)
    scratch[0] = along[2, 0] - h_u - (a * r_x + c * r_y)
    scratch[1] = along[2, 1] - h_v - (b * r_x + d * r_y)
    scratch[2] = -h_uu - (a * a * r_xx + 2 * a * c * r_xy + c * c * r_yy)
    scratch[3] = -h_uv - (a * b * r_xx + (a * d + b * c) * r_xy + c * d * r_yy)
    scratch[4] = -h_vv - (b * b * r_xx + 2 * b * d * r_xy + d * d * r_yy)
    return along[2, 0] * u + along[2, 1] * v + along[2, 2] - h - r


@inner
def coordinates(plane, point):  # type: ignore[no-untyped-def]
    """Return the coordinates of a point (3,) of a plane."""
    u, v = 0.0, 0.0
    for i in range(3):
        u += plane.axes[0, i] * (point[i] - plane.origin[i])
        v += plane.axes[1, i] * (point[i] - plane.origin[i])
    return u, v


@compiled
def write_heights(moving, reference, poses, sums_m, sums_r, P_m, is_wanted, heights):  # type: ignore[no-untyped-def]
    """Write the sums of both form deviations (n, point) [mm] at points of the moving plane and their projections.

    poses       X_RM (n, 12)
    sums_m, sums_r   HeightSums of both planes
    P_m         (n, point, 3) [mm], or (1, point, 3) if they are the same at all poses
    is_wanted   (n, point): which sums are written
    """
    along, weights, scratch = np.empty((3, 3)), np.empty((6, 4)), np.empty(5)
    for k in range(poses.shape[0]):
        write_map(moving, reference, poses[k], along)
        for p in range(heights.shape[1]):
            if not is_wanted[k, p]:
                continue
            u, v = coordinates(moving, P_m[k % P_m.shape[0], p])
            gap = gap_at(moving, reference, sums_m, sums_r, k, along, u, v, weights, scratch)
            heights[k, p] = along[2, 0] * u + along[2, 1] * v + along[2, 2] - gap
