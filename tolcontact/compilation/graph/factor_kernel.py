"""Compiled factorization of the Gram matrix of the rows that carry, joint by joint.

Rows of length 1 have the Gram matrix N N'; the rows of a pair whose slack is open have the products of their openings, too.
Its Cholesky factor has entries only where the elimination of joints in their order joins them (see layout).
"""

from typing import NamedTuple

import numpy as np

from tolcontact.compiled import inlined_uncounted, uncounted

DEPENDENT = 1e-11  # of the square of a row: what remains of it beside the others is rounding


class Work(NamedTuple):
    """The numbers of one QP: min y'y/2 + gradient'y + sum (price s + s^2/2), slopes y + openings s >= bounds, s >= 0.

    slopes       (row, block, 6), openings (row,), bounds (row,)
    gradient     (body, 6), prices (joint,)
    y            (body, 6), slack (joint,): the solution
    is_open      (joint,) whether the slack of the joint may differ from zero
    counts       (joint,) number of rows of the joint that carry; they have the first positions of the joint
    carrying     (position,) these rows
    place        (row,) their positions, or -1
    fresh        (joint,) number of these rows whose entries of the factor are valid
    changed      (joint,) whether the factorization changed entries of the joint
    factor       (position, position) the Cholesky factor, below its diagonal
    multipliers, right_side, column (position,)
    scatter, direction (body, 6), slack_direction (joint,)
    """

    slopes: np.ndarray
    openings: np.ndarray
    bounds: np.ndarray
    gradient: np.ndarray
    prices: np.ndarray
    y: np.ndarray
    slack: np.ndarray
    is_open: np.ndarray
    counts: np.ndarray
    carrying: np.ndarray
    place: np.ndarray
    fresh: np.ndarray
    changed: np.ndarray
    factor: np.ndarray
    multipliers: np.ndarray
    right_side: np.ndarray
    column: np.ndarray
    scatter: np.ndarray
    direction: np.ndarray
    slack_direction: np.ndarray


@inlined_uncounted
def product(layout, slopes, row, vectors):  # type: ignore[no-untyped-def]
    """Return the product of a row with vectors (body, 6)."""
    total = 0.0
    for q in range(layout.block_count[row]):
        body = layout.blocks[row, q]
        total += (
            (slopes[row, q, 0] * vectors[body, 0] + slopes[row, q, 1] * vectors[body, 1])
            + (slopes[row, q, 2] * vectors[body, 2] + slopes[row, q, 3] * vectors[body, 3])
        ) + (slopes[row, q, 4] * vectors[body, 4] + slopes[row, q, 5] * vectors[body, 5])
    return total


@inlined_uncounted
def squared_length(layout, slopes, row):  # type: ignore[no-untyped-def]
    """Return the squared length of a row."""
    total = 0.0
    for q in range(layout.block_count[row]):
        for c in range(6):
            total += slopes[row, q, c] * slopes[row, q, c]
    return total


@inlined_uncounted
def add_row(layout, slopes, row, weight, vectors):  # type: ignore[no-untyped-def]
    """Add a multiple of a row to vectors (body, 6)."""
    for q in range(layout.block_count[row]):
        body = layout.blocks[row, q]
        for c in range(6):
            vectors[body, c] += weight * slopes[row, q, c]


@inlined_uncounted
def set_row(layout, slopes, row, weight, vectors):  # type: ignore[no-untyped-def]
    """Set the bodies of a row in vectors (body, 6) to a multiple of it."""
    for q in range(layout.block_count[row]):
        body = layout.blocks[row, q]
        for c in range(6):
            vectors[body, c] = weight * slopes[row, q, c]


@uncounted
def append(layout, work, row):  # type: ignore[no-untyped-def]
    """Let a row carry, behind the others of its joint."""
    j = layout.joint[row]
    position = layout.positions[j] + work.counts[j]
    work.carrying[position], work.place[row] = row, position
    work.multipliers[position] = 0.0
    work.counts[j] += 1


@uncounted
def remove(layout, work, position):  # type: ignore[no-untyped-def]
    """Let the row at a position carry no longer."""
    j = layout.joint[work.carrying[position]]
    work.place[work.carrying[position]] = -1
    work.counts[j] -= 1
    for s in range(position, layout.positions[j] + work.counts[j]):
        work.carrying[s], work.multipliers[s] = work.carrying[s + 1], work.multipliers[s + 1]
        work.place[work.carrying[s]] = s
    work.fresh[j] = min(work.fresh[j], position - layout.positions[j])
    work.changed[j] = True


@inlined_uncounted
def _eliminated(layout, work, j, position, value):  # type: ignore[no-untyped-def]
    """Return an entry of the factor's next row, in a column of joint j, for its Gram entry."""
    factor, column = work.factor, work.column
    for q in range(layout.prior_starts[j], layout.prior_starts[j + 1]):
        start = layout.positions[layout.prior[q]]
        for t in range(start, start + work.counts[layout.prior[q]]):
            value -= factor[position, t] * column[t]
    for t in range(layout.positions[j], position):
        value -= factor[position, t] * column[t]
    return value


@uncounted
def _factor_row(layout, work, j, position):  # type: ignore[no-untyped-def]
    """Compute the factor's row at a position of joint j, and return whether the row is independent of those before it."""
    factor, column, carrying, counts, scatter = work.factor, work.column, work.carrying, work.counts, work.scatter
    row, start = carrying[position], layout.positions[j]
    opening = work.openings[row] if work.is_open[j] else 0.0
    set_row(layout, work.slopes, row, 1.0, scatter)
    square = squared_length(layout, work.slopes, row) + opening * opening
    rest = square
    for q in range(layout.prior_starts[j], layout.prior_starts[j + 1]):
        k, adjacent = layout.prior[q], layout.adjacent[q]
        for t in range(layout.positions[k], layout.positions[k] + counts[k]):
            value = product(layout, work.slopes, carrying[t], scatter) if adjacent else 0.0
            column[t] = _eliminated(layout, work, k, t, value) / factor[t, t]
            rest -= column[t] * column[t]
    for t in range(start, position):
        value = product(layout, work.slopes, carrying[t], scatter)
        if work.is_open[j]:
            value += opening * work.openings[carrying[t]]
        column[t] = _eliminated(layout, work, j, t, value) / factor[t, t]
        rest -= column[t] * column[t]
    for q in range(layout.prior_starts[j], layout.prior_starts[j + 1]):
        k = layout.prior[q]
        for t in range(layout.positions[k], layout.positions[k] + counts[k]):
            factor[position, t], column[t] = column[t], 0.0
    for t in range(start, position):
        factor[position, t], column[t] = column[t], 0.0
    set_row(layout, work.slopes, row, 0.0, scatter)
    factor[position, position] = np.sqrt(max(rest, 0.0))
    return rest > DEPENDENT * square


@uncounted
def factorize(layout, work):  # type: ignore[no-untyped-def]
    """Complete the factor, and return the number of rows that carry no longer, since they depend on those before them."""
    dropped = 0
    for j in range(work.counts.size):
        for q in range(layout.prior_starts[j], layout.prior_starts[j + 1]):
            if work.changed[layout.prior[q]]:
                work.fresh[j], work.changed[j] = 0, True
        if work.fresh[j] < work.counts[j]:
            work.changed[j] = True
        while work.fresh[j] < work.counts[j]:
            position = layout.positions[j] + work.fresh[j]
            if _factor_row(layout, work, j, position):
                work.fresh[j] += 1
            else:
                remove(layout, work, position)
                dropped += 1
    work.changed[:] = False
    return dropped


@uncounted
def solve(layout, work, values):  # type: ignore[no-untyped-def]
    """Solve with the Gram matrix of the rows that carry, in place; values (position,)."""
    factor, positions, counts = work.factor, layout.positions, work.counts
    for j in range(counts.size):
        for position in range(positions[j], positions[j] + counts[j]):
            value = values[position]
            for q in range(layout.prior_starts[j], layout.prior_starts[j + 1]):
                start = positions[layout.prior[q]]
                for t in range(start, start + counts[layout.prior[q]]):
                    value -= factor[position, t] * values[t]
            for t in range(positions[j], position):
                value -= factor[position, t] * values[t]
            values[position] = value / factor[position, position]
    for j in range(counts.size - 1, -1, -1):
        for position in range(positions[j] + counts[j] - 1, positions[j] - 1, -1):
            value = values[position] / factor[position, position]
            values[position] = value
            for q in range(layout.prior_starts[j], layout.prior_starts[j + 1]):
                start = positions[layout.prior[q]]
                for t in range(start, start + counts[layout.prior[q]]):
                    values[t] -= factor[position, t] * value
            for t in range(positions[j], position):
                values[t] -= factor[position, t] * value
