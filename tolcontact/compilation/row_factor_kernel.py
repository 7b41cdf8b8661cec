"""The Cholesky factor of the flexibility among active rows, one row more or less at a time (see dual_kernel)."""

import numpy as np

from tolcontact.compiled import inner

INDEPENDENT = 1e-6  # of a row's own flexibility: if more remains with active rows held, rounding does not matter
ROUNDING = 2.2e-16  # relative


@inner
def flexibility_between(B, C, i, j):  # type: ignore[no-untyped-def]
    """Return the entry (i, j) of W."""
    total = C[i, j]
    for c in range(len(B)):
        total += B[c, i] * B[c, j]
    return total


@inner
def append_row(work, k, row):  # type: ignore[no-untyped-def]
    """Write column k of the factor U, W = U'U, for a `row` that follows k active ones; return whether it is independent."""
    B, C, factor, y, active = work[0], work[1], work[5], work[6], work[7]
    for j in range(k):
        y[j] = flexibility_between(B, C, row, active[j])
    forward_substitute(factor, k, y)
    own = flexibility_between(B, C, row, row)
    total = own
    for j in range(k):
        factor[j, k] = y[j]
        total -= y[j] * y[j]
    factor[k, k] = np.sqrt(max(total, 0.0))
    if total > INDEPENDENT * own:
        return True
    # The remainder is the quadratic form of W for the row less its combination of active ones, in rounded terms.
    back_substitute(factor, k, y)
    terms = np.sqrt(own)
    for j in range(k):
        terms += abs(y[j]) * np.sqrt(flexibility_between(B, C, active[j], active[j]))
    return total > (k + 4) * ROUNDING * terms * terms


@inner
def forward_substitute(factor, k, y):  # type: ignore[no-untyped-def]
    """Solve U'z = y for the first k unknowns, in place."""
    for j in range(k):
        y[j] /= factor[j, j]
        value = y[j]
        for i in range(j + 1, k):
            y[i] -= value * factor[j, i]


@inner
def back_substitute(factor, k, y):  # type: ignore[no-untyped-def]
    """Solve U z = y for the first k unknowns, in place."""
    for j in range(k - 1, -1, -1):
        for i in range(j + 1, k):
            y[j] -= factor[j, i] * y[i]
        y[j] /= factor[j, j]


@inner
def remove_row(work, k, position):  # type: ignore[no-untyped-def]
    """Take the row at a position out of k active ones; plane rotations make the factor triangular again."""
    factor, active, is_active = work[5], work[7], work[8]
    is_active[active[position]] = False
    for j in range(position, k - 1):
        active[j] = active[j + 1]
        for c in range(j + 2):
            factor[c, j] = factor[c, j + 1]
    for j in range(position, k - 1):
        length = np.hypot(factor[j, j], factor[j + 1, j])
        cosine, sine = factor[j, j] / length, factor[j + 1, j] / length
        for i in range(j, k - 1):
            upper, lower = factor[j, i], factor[j + 1, i]
            factor[j, i], factor[j + 1, i] = cosine * upper + sine * lower, cosine * lower - sine * upper
