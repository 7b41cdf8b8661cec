"""The innermost loops of displacement fields, compiled: sums over realizations, in their order."""

import numpy as np

from tolcontact.compiled import compiled

CHUNK_POINTS = 256  # per pass over the realizations


@compiled
def affine_parts(poses, centre, A):  # type: ignore[no-untyped-def]
    """Write A (n, 3, 4) of the displacements u = A (x - centre, 1) of points x at poses (n, 12).

    Rotation about the part's centre avoids cancellation in the sums.
    """
    for k in range(A.shape[0]):
        for i in range(3):
            A[k, i, 3] = poses[k, 9 + i]
            for j in range(3):
                A[k, i, j] = poses[k, 3 * i + j] - (1.0 if i == j else 0.0)
                A[k, i, 3] += A[k, i, j] * centre[j]


@compiled
def add_scatter(A, mean, scatter):  # type: ignore[no-untyped-def]
    """Write the mean (3, 4) of A (n, 3, 4), and add the products of the rows' deviations from it to scatter (3, 4, 4)."""
    n = A.shape[0]
    for i in range(3):
        x = y = z = t = 0.0
        for k in range(n):
            x, y, z, t = x + A[k, i, 0], y + A[k, i, 1], z + A[k, i, 2], t + A[k, i, 3]
        x, y, z, t = x / n, y / n, z / n, t / n
        # Separate scalars keep the sums in the processor's registers.
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
def add_wide_scatter(A, mean, scatter):  # type: ignore[no-untyped-def]
    """Write the mean (3, w) of A (n, 3, w), and add the products of the rows' deviations from it to scatter (3, w, w)."""
    n, _, width = A.shape
    difference = np.empty(width)
    for i in range(3):
        for p in range(width):
            total = 0.0
            for k in range(n):
                total += A[k, i, p]
            mean[i, p] = total / n
        for k in range(n):
            for p in range(width):
                difference[p] = A[k, i, p] - mean[i, p]
            for p in range(width):
                value = difference[p]
                if value != 0.0:
                    for q in range(width):
                        scatter[i, p, q] += value * difference[q]


@compiled
def add_bent_magnitudes(A, basis, shift, powers):  # type: ignore[no-untyped-def]
    """Add powers as add_magnitudes does, for u = A . basis with A (n, 3, w) and basis (3, w, point)."""
    u = np.empty((3, shift.size))
    for k in range(A.shape[0]):
        for i in range(3):
            for v in range(shift.size):
                u[i, v] = 0.0
            for p in range(A.shape[2]):
                value = A[k, i, p]
                if value != 0.0:
                    for v in range(shift.size):
                        u[i, v] += value * basis[i, p, v]
        for v in range(shift.size):
            power1 = np.sqrt(u[0, v] ** 2 + u[1, v] ** 2 + u[2, v] ** 2) - shift[v]
            power2 = power1 * power1
            powers[0, v] += power1
            powers[1, v] += power2
            powers[2, v] += power2 * power1
            powers[3, v] += power2 * power2


@compiled
def add_magnitudes(A, points, shift, powers):  # type: ignore[no-untyped-def]
    """Add to powers (4, point) the first to fourth power of |u| - shift, realization after realization.

    u = A @ (x, y, z, 1) for A (n, 3, 4), points (3, point), shift (point,).
    """
    for start in range(0, shift.size, CHUNK_POINTS):
        stop = min(start + CHUNK_POINTS, shift.size)
        x, y, z, offset = points[0, start:stop], points[1, start:stop], points[2, start:stop], shift[start:stop]
        sum1, sum2, sum3, sum4 = powers[0, start:stop], powers[1, start:stop], powers[2, start:stop], powers[3, start:stop]
        for k in range(A.shape[0]):
            a, b, c = A[k, 0], A[k, 1], A[k, 2]
            for v in range(x.size):
                u = a[0] * x[v] + a[1] * y[v] + a[2] * z[v] + a[3]
                w = b[0] * x[v] + b[1] * y[v] + b[2] * z[v] + b[3]
                t = c[0] * x[v] + c[1] * y[v] + c[2] * z[v] + c[3]
                power1 = np.sqrt(u * u + w * w + t * t) - offset[v]
                power2 = power1 * power1
                sum1[v] += power1
                sum2[v] += power2
                sum3[v] += power2 * power1
                sum4[v] += power2 * power2
