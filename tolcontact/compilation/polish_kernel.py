"""Compiled solution of the optimality conditions with the rows that carry as equations.

BLAS would share such small systems among threads that wait for each other, and its sums depend on the number of threads.
"""

import numpy as np

from tolcontact.compiled import compiled, uncounted


@compiled
def solve_conditions(H, gradient, rows, bounds, carries, compliance, refinements, solution):  # type: ignore[no-untyped-def]
    """Solve H x - C'm = -g, C x = b, C the rows that carry; write x and the multipliers m (QP, n + row), 0 of other rows.

    H (QP, n, n), gradient (QP, n), rows (QP, row, n), bounds (QP, row), carries (QP, row). The rows yield by a `compliance` in
    the factorization, whose effect refinements remove. Without a solution all is NaN.
    """
    size = H.shape[1]
    for k in range(H.shape[0]):
        active = np.flatnonzero(carries[k])
        total = size + active.size
        K, right, x = np.zeros((total, total)), np.empty(total), np.zeros(total)
        K[:size, :size] = H[k]
        right[:size] = -gradient[k]
        for p in range(active.size):
            right[size + p] = bounds[k, active[p]]
            for i in range(size):
                K[size + p, i], K[i, size + p] = rows[k, active[p], i], -rows[k, active[p], i]
        factor, pivots, remainder, buffer = K.copy(), np.arange(total), np.empty(total), np.empty(total)
        for p in range(size, total):
            factor[p, p] += compliance
        solution[k] = np.nan
        if not _factorize(factor, pivots):
            continue
        for _ in range(refinements):
            for i in range(total):
                remainder[i] = right[i]
                for j in range(total):
                    remainder[i] -= K[i, j] * x[j]
            _add_solution(factor, pivots, remainder, buffer, x)
        solution[k] = 0.0
        solution[k, :size] = x[:size]
        for p in range(active.size):
            solution[k, size + active[p]] = x[size + p]


@uncounted
def _factorize(factor, pivots):  # type: ignore[no-untyped-def]
    """Replace a matrix by its factors L and U, with rows exchanged as `pivots` say; return whether it is regular."""
    total = factor.shape[0]
    for c in range(total):
        best = c
        for i in range(c + 1, total):
            if abs(factor[i, c]) > abs(factor[best, c]):
                best = i
        if not abs(factor[best, c]) > 0:  # nor for numbers that are none
            return False
        if best != c:
            pivots[c], pivots[best] = pivots[best], pivots[c]
            for j in range(total):
                factor[c, j], factor[best, j] = factor[best, j], factor[c, j]
        for i in range(c + 1, total):
            if factor[i, c] != 0:
                factor[i, c] /= factor[c, c]
                share = factor[i, c]
                for j in range(c + 1, total):
                    factor[i, j] -= share * factor[c, j]
    return True


@uncounted
def _add_solution(factor, pivots, right, solved, x):  # type: ignore[no-untyped-def]
    """Add to x the solution of the factorized system for a right side, which is computed in the buffer `solved`."""
    total = factor.shape[0]
    for i in range(total):
        solved[i] = right[pivots[i]]
        for j in range(i):
            solved[i] -= factor[i, j] * solved[j]
    for i in range(total - 1, -1, -1):
        for j in range(i + 1, total):
            solved[i] -= factor[i, j] * solved[j]
        solved[i] /= factor[i, i]
    for i in range(total):
        x[i] += solved[i]
