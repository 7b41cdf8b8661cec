"""Compiled factorizations: of H = C C', and of the Gram matrix of the active rows, joint by joint.

The block Cholesky factor C transforms a QP so that H is the identity: its rows become C^-1 a.

Rows of length 1 have the Gram matrix N N'. For rows of a pair whose slack is open, the products of their openings are added.
The Cholesky factor has entries only between joints that the elimination order connects (see graph_solver).
"""

from typing import NamedTuple

import numpy as np

from tolcontact.compiled import inlined_inner, inner

# Relative pivots below which a row is dependent. Pivots of open slacks are squares of openings, which are tiny.
DEPENDENT, DEPENDENT_IF_OPEN = 1e-11, 1e-14


class Work(NamedTuple):
    """The numbers of one QP: min y'y/2 + gradient'y + sum (price s + s^2/2), slopes y + opening s >= bound, s >= 0.

    slopes      (row, block, 6)
    opening, bound  (row,)
    position    (row,) position of each active row, -1 for inactive rows
    gradient, y, scatter, direction  (body, 6): the gradient, the solution y, one row among zeros, the direction of y
    counts      (joint,) number of active rows of the joint, which take its first positions
    fresh       (joint,) number of these rows with valid entries of the factor
    changed     (joint,) whether other entries have changed
    open        (joint,) whether the slack is open
    price, value, change  (joint,) price, value and direction of the slack; the value of a closed slack is the multiplier of its
                bound, times -1
    factor      (position, position) the Cholesky factor: lower triangle with diagonal
    active      (position,) indices of the active rows
    multiplier, step, column  (position,): multipliers of the active rows, a step of the multipliers, the next row of the factor
    """

    slopes: np.ndarray
    opening: np.ndarray
    bound: np.ndarray
    position: np.ndarray
    gradient: np.ndarray
    y: np.ndarray
    scatter: np.ndarray
    direction: np.ndarray
    counts: np.ndarray
    fresh: np.ndarray
    changed: np.ndarray
    open: np.ndarray
    price: np.ndarray
    value: np.ndarray
    change: np.ndarray
    factor: np.ndarray
    active: np.ndarray
    multiplier: np.ndarray
    step: np.ndarray
    column: np.ndarray


@inlined_inner
def product(blocks, slopes, row, vectors):  # type: ignore[no-untyped-def]
    """Return the product of a row with vectors (body, 6)."""
    total = 0.0
    for q in range(blocks[row, 0]):
        body = blocks[row, q + 1]
        total += (
            (slopes[row, q, 0] * vectors[body, 0] + slopes[row, q, 1] * vectors[body, 1])
            + (slopes[row, q, 2] * vectors[body, 2] + slopes[row, q, 3] * vectors[body, 3])
        ) + (slopes[row, q, 4] * vectors[body, 4] + slopes[row, q, 5] * vectors[body, 5])
    return total


@inlined_inner
def squared_length(blocks, slopes, row):  # type: ignore[no-untyped-def]
    """Return the squared length of a row."""
    total = 0.0
    for q in range(blocks[row, 0]):
        for c in range(6):
            total += slopes[row, q, c] * slopes[row, q, c]
    return total


@inlined_inner
def add_row(blocks, slopes, row, weight, vectors):  # type: ignore[no-untyped-def]
    """Add a multiple of a row to vectors (body, 6)."""
    for q in range(blocks[row, 0]):
        body = blocks[row, q + 1]
        for c in range(6):
            vectors[body, c] += weight * slopes[row, q, c]


@inlined_inner
def set_row(blocks, slopes, row, weight, vectors):  # type: ignore[no-untyped-def]
    """Set the bodies of a row in vectors (body, 6) to a multiple of it."""
    for q in range(blocks[row, 0]):
        body = blocks[row, q + 1]
        for c in range(6):
            vectors[body, c] = weight * slopes[row, q, c]


@inlined_inner
def has_position(layout, work, j):  # type: ignore[no-untyped-def]
    """Return whether one more row of joint j can be active. More rows than positions are dependent, up to rounding."""
    return layout.first[j] + work.counts[j] < layout.first[j + 1]


@inlined_inner
def append(layout, work, row):  # type: ignore[no-untyped-def]
    """Activate a row, after the other active rows of its joint, which must have a position left."""
    j = layout.joint[row]
    position = layout.first[j] + work.counts[j]
    work.active[position], work.position[row] = row, position
    work.multiplier[position] = 0.0
    work.counts[j] += 1


@inlined_inner
def remove(layout, work, position):  # type: ignore[no-untyped-def]
    """Deactivate the row at a position."""
    j = layout.joint[work.active[position]]
    work.position[work.active[position]] = -1
    work.counts[j] -= 1
    for s in range(position, layout.first[j] + work.counts[j]):
        work.active[s], work.multiplier[s] = work.active[s + 1], work.multiplier[s + 1]
        work.position[work.active[s]] = s
    work.fresh[j] = min(work.fresh[j], position - layout.first[j])
    work.changed[j] = 1


@inlined_inner
def _eliminated(layout, work, j, position, value, solution):  # type: ignore[no-untyped-def]
    """Return a right side's value at a position of joint j, less the contributions of the solution (position,) before it."""
    factor = work.factor
    for q in range(layout.prior_start[j], layout.prior_start[j + 1]):
        start = layout.first[layout.prior[q, 0]]
        for t in range(start, start + work.counts[layout.prior[q, 0]]):
            value -= factor[position, t] * solution[t]
    for t in range(layout.first[j], position):
        value -= factor[position, t] * solution[t]
    return value


@inlined_inner
def _factor_row(layout, work, j, position, threshold):  # type: ignore[no-untyped-def]
    """Compute the factor's row at a position of joint j, and return whether the row is independent of the rows before it."""
    factor, column, active, scatter = work.factor, work.column, work.active, work.scatter
    row, start = active[position], layout.first[j]
    opening = work.opening[row] if work.open[j] else 0.0
    set_row(layout.blocks, work.slopes, row, 1.0, scatter)
    square = squared_length(layout.blocks, work.slopes, row) + opening * opening
    pivot = square
    for q in range(layout.prior_start[j], layout.prior_start[j + 1]):
        k, adjacent = layout.prior[q, 0], layout.prior[q, 1]
        for t in range(layout.first[k], layout.first[k] + work.counts[k]):
            value = product(layout.blocks, work.slopes, active[t], scatter) if adjacent else 0.0
            column[t] = _eliminated(layout, work, k, t, value, column) / factor[t, t]
            pivot -= column[t] * column[t]
    for t in range(start, position):
        value = product(layout.blocks, work.slopes, active[t], scatter)
        if work.open[j]:
            value += opening * work.opening[active[t]]
        column[t] = _eliminated(layout, work, j, t, value, column) / factor[t, t]
        pivot -= column[t] * column[t]
    for q in range(layout.prior_start[j], layout.prior_start[j + 1]):
        k = layout.prior[q, 0]
        for t in range(layout.first[k], layout.first[k] + work.counts[k]):
            factor[position, t], column[t] = column[t], 0.0
    for t in range(start, position):
        factor[position, t], column[t] = column[t], 0.0
    set_row(layout.blocks, work.slopes, row, 0.0, scatter)
    factor[position, position] = np.sqrt(max(pivot, 0.0))
    return pivot > threshold * square


@inlined_inner
def any_open(work):  # type: ignore[no-untyped-def]
    """Return whether a slack is open."""
    is_open = False
    for j in range(work.counts.size):
        is_open = is_open or work.open[j] > 0
    return is_open


@inlined_inner
def dependence(work):  # type: ignore[no-untyped-def]
    """Return the relative pivot below which a row counts as linearly dependent."""
    return DEPENDENT_IF_OPEN if any_open(work) else DEPENDENT


@inlined_inner
def factorize(layout, work):  # type: ignore[no-untyped-def]
    """Complete the factor, and return the number of rows that are dropped, since they depend on rows before them."""
    dropped, threshold = 0, dependence(work)
    for j in range(work.counts.size):
        for q in range(layout.prior_start[j], layout.prior_start[j + 1]):
            if work.changed[layout.prior[q, 0]]:
                work.fresh[j], work.changed[j] = 0, 1
        if work.fresh[j] < work.counts[j]:
            work.changed[j] = 1
        while work.fresh[j] < work.counts[j]:
            position = layout.first[j] + work.fresh[j]
            if _factor_row(layout, work, j, position, threshold):
                work.fresh[j] += 1
            else:
                remove(layout, work, position)
                dropped += 1
    for j in range(work.counts.size):
        work.changed[j] = 0
    return dropped


@inlined_inner
def solve(layout, work, values):  # type: ignore[no-untyped-def]
    """Solve with the Gram matrix of the active rows, in place; values (position,)."""
    factor = work.factor
    for j in range(work.counts.size):
        for position in range(layout.first[j], layout.first[j] + work.counts[j]):
            values[position] = _eliminated(layout, work, j, position, values[position], values) / factor[position, position]
    for j in range(work.counts.size - 1, -1, -1):
        for position in range(layout.first[j] + work.counts[j] - 1, layout.first[j] - 1, -1):
            value = values[position] / factor[position, position]
            values[position] = value
            for q in range(layout.prior_start[j], layout.prior_start[j + 1]):
                start = layout.first[layout.prior[q, 0]]
                for t in range(start, start + work.counts[layout.prior[q, 0]]):
                    values[t] -= factor[position, t] * value
            for t in range(layout.first[j], position):
                values[t] -= factor[position, t] * value


@inlined_inner
def _cholesky(block):  # type: ignore[no-untyped-def]
    """Replace a block (6, 6) by its Cholesky factor; return whether it is positive definite."""
    for i in range(6):
        for j in range(i + 1):
            value = block[i, j]
            for c in range(j):
                value -= block[i, c] * block[j, c]
            if j < i:
                block[i, j] = value / block[j, j]
            elif value > 0.0:
                block[i, i] = np.sqrt(value)
            else:
                return False
    return True


@inlined_inner
def _divide(block, triangle):  # type: ignore[no-untyped-def]
    """Replace a block by its product with the inverse transpose of a lower triangle."""
    for i in range(6):
        for j in range(6):
            value = block[i, j]
            for c in range(j):
                value -= block[i, c] * triangle[j, c]
            block[i, j] = value / triangle[j, j]


@inlined_inner
def _subtract(block, left, right):  # type: ignore[no-untyped-def]
    """Subtract left right' from a block."""
    for i in range(6):
        for j in range(6):
            value = block[i, j]
            for c in range(6):
                value -= left[i, c] * right[j, c]
            block[i, j] = value


@inner
def load_hessian(layout, nonzeros, k, blocks):  # type: ignore[no-untyped-def]
    """Write the factor of problem k into `blocks`; return whether H is positive definite."""
    blocks[:] = 0.0
    for entry in range(layout.hessian_entries.size):
        if layout.hessian_entries[entry] >= 0:
            block, offset = divmod(layout.hessian_entries[entry], 36)
            blocks[block, offset // 6, offset % 6] = nonzeros[k, entry]
    starts, columns, block_of = layout.starts, layout.columns, layout.block_of
    for body in range(starts.size - 1):
        diagonal = starts[body + 1] - 1
        for b in range(starts[body], diagonal):
            column = columns[b]
            for e in range(starts[body], b):
                if block_of[column, columns[e]] >= 0:
                    _subtract(blocks[b], blocks[e], blocks[block_of[column, columns[e]]])
            _divide(blocks[b], blocks[starts[column + 1] - 1])
            _subtract(blocks[diagonal], blocks[b], blocks[b])
        if not _cholesky(blocks[diagonal]):
            return False
    return True


@inlined_inner
def _forward(triangle, vector):  # type: ignore[no-untyped-def]
    """Solve with a lower triangle, in place."""
    for i in range(6):
        value = vector[i]
        for c in range(i):
            value -= triangle[i, c] * vector[c]
        vector[i] = value / triangle[i, i]


@inner
def vectors_to_unit(layout, blocks, vectors):  # type: ignore[no-untyped-def]
    """Multiply vectors (body, 6) by C^-1, in place."""
    starts, columns = layout.starts, layout.columns
    for body in range(starts.size - 1):
        diagonal = starts[body + 1] - 1
        for b in range(starts[body], diagonal):
            for i in range(6):
                for c in range(6):
                    vectors[body, i] -= blocks[b, i, c] * vectors[columns[b], c]
        _forward(blocks[diagonal], vectors[body])


@inner
def from_unit(layout, blocks, vectors):  # type: ignore[no-untyped-def]
    """Multiply vectors (body, 6) by C'^-1, in place."""
    starts, columns = layout.starts, layout.columns
    for body in range(starts.size - 2, -1, -1):
        diagonal = starts[body + 1] - 1
        for i in range(5, -1, -1):
            value = vectors[body, i]
            for c in range(i + 1, 6):
                value -= blocks[diagonal, c, i] * vectors[body, c]
            vectors[body, i] = value / blocks[diagonal, i, i]
        for b in range(starts[body], diagonal):
            for i in range(6):
                for c in range(6):
                    vectors[columns[b], c] -= blocks[b, i, c] * vectors[body, i]


@inner
def rows_to_unit(layout, blocks, slopes):  # type: ignore[no-untyped-def]
    """Multiply the slopes (row, block, 6) of all rows by C^-1, in place."""
    starts = layout.starts
    for row in range(slopes.shape[0]):
        for q in range(layout.blocks[row, 0]):
            body = layout.blocks[row, q + 1]
            _forward(blocks[starts[body + 1] - 1], slopes[row, q])
            for p in range(q + 1, layout.blocks[row, 0]):
                b = layout.block_of[layout.blocks[row, p + 1], body]
                if b >= 0:
                    for i in range(6):
                        for c in range(6):
                            slopes[row, p, i] -= blocks[b, i, c] * slopes[row, q, c]
