"""The innermost loops of displacement fields, compiled: sums over realizations, in their order."""

import numpy as np

from tolcontact.compiled import compiled

CHUNK = 256  # points that are summed up together


@compiled
def affine_parts(poses, centre, A):  # type: ignore[no-untyped-def]
    """A (n, 3, 4) of the displacements u = A (x - centre, 1) of points x at poses (n, 12).

    Turning about the part's middle keeps the sums free of cancellation.
    """
    for k in range(A.shape[0]):
        for i in range(3):
            A[k, i, 3] = poses[k, 9 + i]
            for j in range(3):
                A[k, i, j] = poses[k, 3 * i + j] - (1.0 if i == j else 0.0)
                A[k, i, 3] += A[k, i, j] * centre[j]


@compiled
def add_scatter(A, mean, scatter):  # type: ignore[no-untyped-def]
    """Write the mean (3, 4) of A (n, 3, 4), and add to scatter (3, 4, 4) the products of each row's deviations from it."""
    for i in range(3):
        for a in range(4):
            total = 0.0
            for k in range(A.shape[0]):
                total += A[k, i, a]
            mean[i, a] = total / A.shape[0]
        for k in range(A.shape[0]):
            for a in range(4):
                rest = A[k, i, a] - mean[i, a]
                for b in range(a + 1):
                    scatter[i, a, b] += rest * (A[k, i, b] - mean[i, b])
        for a in range(4):
            for b in range(a):
                scatter[i, b, a] = scatter[i, a, b]


@compiled
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
