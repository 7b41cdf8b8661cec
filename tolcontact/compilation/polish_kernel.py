"""Compiled solution of the optimality conditions with the active rows as equations.

BLAS would distribute such small systems over threads that wait for each other, and its sums depend on the number of threads.
"""

import numpy as np

from tolcontact.compiled import compiled, uncounted


@compiled
def solve_conditions(problem, active, is_open, order, compliance, refinements, solution):  # type: ignore[no-untyped-def]
    """Solve H x + g - C'm - (0, p) = 0, C x = b, with the active rows C; write x, m (QP, n + row), 0 for other rows, and p.

    problem    H (QP, n, n), g (QP, n), rows (QP, row, n), b (QP, row); H is the identity for slacks, the last variables
    active     (QP, row)
    is_open    (QP, slack): whether a slack is positive; other slacks are 0, and have a multiplier p
    order      (n - slack + row,): variables without slacks, and rows after them, in an order that gives a narrow band matrix

    Positive slacks s = C'm - g are eliminated, which leaves entries C C' for rows that share a slack. The rows have a small
    `compliance` in the factorization, and iterative refinement removes its effect. Without a solution, all results are NaN.
    """
    H, gradient, rows, bounds = problem
    for k in range(len(H)):
        positions, total = _positions(active[k], H.shape[1] - is_open.shape[1], order)
        K, right = _conditions(H[k], gradient[k], rows[k], bounds[k], is_open[k], positions, total)
        x = np.zeros(total)
        if _solve(K, right, positions[len(positions) - rows.shape[1] :], compliance, refinements, x):
            _write(x, positions, gradient[k], rows[k], is_open[k], solution[k])
        else:
            solution[k] = np.nan


@compiled
def _positions(active, size, order):  # type: ignore[no-untyped-def]
    """Return the position of each variable and row among the unknowns, -1 for inactive rows, and the number of unknowns."""
    positions, total = np.full(len(order), -1), 0
    for unknown in order:
        if unknown < size or active[unknown - size]:
            positions[unknown] = total
            total += 1
    return positions, total


@compiled
def _solve(K, right, rows, compliance, refinements, x):  # type: ignore[no-untyped-def]
    """Add the solution of K x = right to x, with compliant `rows` in the factorization; return whether a solution exists."""
    factor, pivots, remainder, width = K.copy(), np.arange(len(x)), np.empty(len(x)), _half_width(K)
    for row in rows:
        if row >= 0:
            factor[row, row] += compliance
    if not _factorize(factor, pivots, width):
        return False
    for _ in range(refinements):
        for i in range(len(x)):
            remainder[i] = right[i]
            for j in range(max(i - width, 0), min(i + width + 1, len(x))):
                remainder[i] -= K[i, j] * x[j]
        _add_solution(factor, pivots, width, remainder, x)
    return True


@uncounted
def _write(x, positions, gradient, rows, is_open, solution):  # type: ignore[no-untyped-def]
    """Write variables, multipliers of rows and multipliers of slacks into a solution (n + row + slack,)."""
    size, slacks, count = len(gradient) - len(is_open), len(is_open), len(rows)
    solution[:] = 0.0
    for i in range(size):
        solution[i] = x[positions[i]]
    multipliers = solution[size + slacks :]
    for row in range(count):
        if positions[size + row] >= 0:
            multipliers[row] = x[positions[size + row]]
    for slack in range(slacks):
        value = -gradient[size + slack]
        for row in range(count):
            value += rows[row, size + slack] * multipliers[row]
        if is_open[slack]:
            solution[size + slack] = value
        else:
            multipliers[count + slack] = -value


@compiled
def _conditions(H, gradient, rows, bounds, is_open, positions, total):  # type: ignore[no-untyped-def]
    """Return the matrix and the right side of the conditions; `positions` of unknowns are -1 if they are omitted."""
    size = H.shape[0] - len(is_open)
    K, right, sharing = np.zeros((total, total)), np.empty(total), np.empty(len(bounds), dtype=np.int64)
    for i in range(size):
        right[positions[i]] = -gradient[i]
        for j in range(size):
            K[positions[i], positions[j]] = H[i, j]
    for row in range(len(bounds)):
        p = positions[size + row]
        if p >= 0:
            right[p] = bounds[row]
            for i in range(size):
                K[p, positions[i]], K[positions[i], p] = rows[row, i], -rows[row, i]
    for slack in range(len(is_open)):
        if is_open[slack]:
            column, count = size + slack, 0
            for row in range(len(bounds)):
                if positions[size + row] >= 0 and rows[row, column] != 0:
                    sharing[count] = row
                    count += 1
            for row in sharing[:count]:
                p = positions[size + row]
                right[p] += rows[row, column] * gradient[column]
                for other in sharing[:count]:
                    K[p, positions[size + other]] += rows[row, column] * rows[other, column]
    return K, right


@uncounted
def _half_width(K):  # type: ignore[no-untyped-def]
    """Return the largest distance of an entry from the diagonal."""
    total, width = len(K), 0
    for i in range(total):
        for j in range(i + width + 1, total):
            if K[i, j] != 0 or K[j, i] != 0:
                width = j - i
    return width


@uncounted
def _factorize(factor, pivots, width):  # type: ignore[no-untyped-def]
    """Replace a band matrix by its factors L and U; write the row exchanged with each row into `pivots`.

    Return whether the matrix is regular. Later exchanges do not affect columns of L.
    """
    total = factor.shape[0]
    for c in range(total):
        best, below, right = c, min(c + width + 1, total), min(c + 2 * width + 1, total)
        for i in range(c + 1, below):
            if abs(factor[i, c]) > abs(factor[best, c]):
                best = i
        if not abs(factor[best, c]) > 0:  # also rejects NaN
            return False
        pivots[c] = best
        if best != c:
            for j in range(c, right):
                factor[c, j], factor[best, j] = factor[best, j], factor[c, j]
        for i in range(c + 1, below):
            if factor[i, c] != 0:
                factor[i, c] /= factor[c, c]
                share = factor[i, c]
                for j in range(c + 1, right):
                    factor[i, j] -= share * factor[c, j]
    return True


@uncounted
def _add_solution(factor, pivots, width, right, x):  # type: ignore[no-untyped-def]
    """Add the solution of the factorized system for a right side, which is overwritten, to x."""
    total = factor.shape[0]
    for c in range(total):
        right[c], right[pivots[c]] = right[pivots[c]], right[c]
        for i in range(c + 1, min(c + width + 1, total)):
            right[i] -= factor[i, c] * right[c]
    for i in range(total - 1, -1, -1):
        for j in range(i + 1, min(i + 2 * width + 1, total)):
            right[i] -= factor[i, j] * right[j]
        right[i] /= factor[i, i]
    for i in range(total):
        x[i] += right[i]
