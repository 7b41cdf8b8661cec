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
    n = A.shape[0]
    for i in range(3):
        x = y = z = t = 0.0
        for k in range(n):
            x, y, z, t = x + A[k, i, 0], y + A[k, i, 1], z + A[k, i, 2], t + A[k, i, 3]
        x, y, z, t = x / n, y / n, z / n, t / n
        # Sums in names of their own stay in the processor's registers.
        xx = xy = xz = xt = yy = yz = yt = zz = zt = tt = 0.0
        for k in range(n):
            a, b, c, d = A[k, i, 0] - x, A[k, i, 1] - y, A[k, i, 2] - z, A[k, i, 3] - t
            xx, xy, xz, xt = xx + a * a, xy + a * b, xz + a * c, xt + a * d
            yy, yz, yt, zz, zt, tt = yy + b * b, yz + b * c, yt + b * d, zz + c * c, zt + c * d, tt + d * d
        mean[i, 0], mean[i, 1], mean[i, 2], mean[i, 3] = x, y, z, t
        products = ((xx, xy, xz, xt), (xy, yy, yz, yt), (xz, yz, zz, zt), (xt, yt, zt, tt))
        for p in range(4):
            for q in range(4):
                scatter[i, p, q] += products[p][q]


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
