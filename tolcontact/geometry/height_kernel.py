"""Compiled form deviations of planes, from spline tables, and the gap between two planes with form deviation."""

import math
from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled, inner


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
