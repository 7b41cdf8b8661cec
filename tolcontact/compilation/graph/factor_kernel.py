"""Compiled factorization of the Gram matrix of the active rows, joint by joint.

Rows of length 1 have the Gram matrix N N'. For rows of a pair whose slack is open, the products of their openings are added.
The Cholesky factor has entries only between joints that the elimination order connects (see layout).
"""

from typing import NamedTuple

import numpy as np

from tolcontact.compilation.graph.layout import JOINT, POSITION, PRIOR
from tolcontact.compiled import inlined_inner

# Relative pivots below which a row is dependent. Pivots of open slacks are squares of openings, which are tiny.
DEPENDENT, DEPENDENT_IF_OPEN = 1e-11, 1e-14


OPENING, BOUND = range(2)  # columns of Work.rows
GRADIENT, Y, SCATTER, DIRECTION = range(4)  # of Work.vectors
COUNT, FRESH, CHANGED, OPEN = range(4)  # columns of Work.joints
PRICE, VALUE, CHANGE = range(3)  # of Work.slacks
MULTIPLIER, STEP, COLUMN = range(3)  # of Work.positions


class Work(NamedTuple):
    """The numbers of one QP: min y'y/2 + gradient'y + sum (price s + s^2/2), slopes y + openings s >= bounds, s >= 0.

    slopes      (row, block, 6)
    rows        (row, 2) openings and bounds
    position    (row,) position of each active row, -1 for inactive rows
    vectors     (4, body, 6) the gradient, the solution y, one row among zeros, the direction of y
    joints      (joint, 4) number of active rows of the joint, which take its first positions; number of these rows with valid
                entries of the factor; whether other entries have changed; whether the slack is open
    slacks      (3, joint) price, value and direction; the value of a closed slack is the multiplier of its bound, times -1
    factor      (position, position) the Cholesky factor: lower triangle with diagonal
    active      (position,) indices of the active rows
    positions   (3, position) multipliers of the active rows, a step of the multipliers, the next row of the factor
    """

    slopes: np.ndarray
    rows: np.ndarray
    position: np.ndarray
    vectors: np.ndarray
    joints: np.ndarray
    slacks: np.ndarray
    factor: np.ndarray
    active: np.ndarray
    positions: np.ndarray


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
    return layout.joints[j, POSITION] + work.joints[j, COUNT] < layout.joints[j + 1, POSITION]


@inlined_inner
def append(layout, work, row):  # type: ignore[no-untyped-def]
    """Activate a row, after the other active rows of its joint, which must have a position left."""
    j = layout.rows[row, JOINT]
    position = layout.joints[j, POSITION] + work.joints[j, COUNT]
    work.active[position], work.position[row] = row, position
    work.positions[MULTIPLIER, position] = 0.0
    work.joints[j, COUNT] += 1


@inlined_inner
def remove(layout, work, position):  # type: ignore[no-untyped-def]
    """Deactivate the row at a position."""
    j = layout.rows[work.active[position], JOINT]
    work.position[work.active[position]] = -1
    work.joints[j, COUNT] -= 1
    for s in range(position, layout.joints[j, POSITION] + work.joints[j, COUNT]):
        work.active[s], work.positions[MULTIPLIER, s] = work.active[s + 1], work.positions[MULTIPLIER, s + 1]
        work.position[work.active[s]] = s
    work.joints[j, FRESH] = min(work.joints[j, FRESH], position - layout.joints[j, POSITION])
    work.joints[j, CHANGED] = 1


@inlined_inner
def _eliminated(layout, work, j, position, value, solution):  # type: ignore[no-untyped-def]
    """Return a right side's value at a position of joint j, less the contributions of the solution (position,) before it."""
    factor = work.factor
    for q in range(layout.joints[j, PRIOR], layout.joints[j + 1, PRIOR]):
        start = layout.joints[layout.prior[q, 0], POSITION]
        for t in range(start, start + work.joints[layout.prior[q, 0], COUNT]):
            value -= factor[position, t] * solution[t]
    for t in range(layout.joints[j, POSITION], position):
        value -= factor[position, t] * solution[t]
    return value


@inlined_inner
def _factor_row(layout, work, j, position, threshold):  # type: ignore[no-untyped-def]
    """Compute the factor's row at a position of joint j, and return whether the row is independent of the rows before it."""
    factor, column, active, scatter = work.factor, work.positions[COLUMN], work.active, work.vectors[SCATTER]
    row, start = active[position], layout.joints[j, POSITION]
    opening = work.rows[row, OPENING] if work.joints[j, OPEN] else 0.0
    set_row(layout.blocks, work.slopes, row, 1.0, scatter)
    square = squared_length(layout.blocks, work.slopes, row) + opening * opening
    pivot = square
    for q in range(layout.joints[j, PRIOR], layout.joints[j + 1, PRIOR]):
        k, adjacent = layout.prior[q, 0], layout.prior[q, 1]
        for t in range(layout.joints[k, POSITION], layout.joints[k, POSITION] + work.joints[k, COUNT]):
            value = product(layout.blocks, work.slopes, active[t], scatter) if adjacent else 0.0
            column[t] = _eliminated(layout, work, k, t, value, column) / factor[t, t]
            pivot -= column[t] * column[t]
    for t in range(start, position):
        value = product(layout.blocks, work.slopes, active[t], scatter)
        if work.joints[j, OPEN]:
            value += opening * work.rows[active[t], OPENING]
        column[t] = _eliminated(layout, work, j, t, value, column) / factor[t, t]
        pivot -= column[t] * column[t]
    for q in range(layout.joints[j, PRIOR], layout.joints[j + 1, PRIOR]):
        k = layout.prior[q, 0]
        for t in range(layout.joints[k, POSITION], layout.joints[k, POSITION] + work.joints[k, COUNT]):
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
    for j in range(work.joints.shape[0]):
        is_open = is_open or work.joints[j, OPEN] > 0
    return is_open


@inlined_inner
def dependence(work):  # type: ignore[no-untyped-def]
    """Return the relative pivot below which a row counts as linearly dependent."""
    return DEPENDENT_IF_OPEN if any_open(work) else DEPENDENT


@inlined_inner
def factorize(layout, work):  # type: ignore[no-untyped-def]
    """Complete the factor, and return the number of rows that are dropped, since they depend on rows before them."""
    dropped, threshold = 0, dependence(work)
    for j in range(work.joints.shape[0]):
        for q in range(layout.joints[j, PRIOR], layout.joints[j + 1, PRIOR]):
            if work.joints[layout.prior[q, 0], CHANGED]:
                work.joints[j, FRESH], work.joints[j, CHANGED] = 0, 1
        if work.joints[j, FRESH] < work.joints[j, COUNT]:
            work.joints[j, CHANGED] = 1
        while work.joints[j, FRESH] < work.joints[j, COUNT]:
            position = layout.joints[j, POSITION] + work.joints[j, FRESH]
            if _factor_row(layout, work, j, position, threshold):
                work.joints[j, FRESH] += 1
            else:
                remove(layout, work, position)
                dropped += 1
    for j in range(work.joints.shape[0]):
        work.joints[j, CHANGED] = 0
    return dropped


@inlined_inner
def solve(layout, work, values):  # type: ignore[no-untyped-def]
    """Solve with the Gram matrix of the active rows, in place; values (position,)."""
    factor = work.factor
    for j in range(work.joints.shape[0]):
        for position in range(layout.joints[j, POSITION], layout.joints[j, POSITION] + work.joints[j, COUNT]):
            values[position] = _eliminated(layout, work, j, position, values[position], values) / factor[position, position]
    for j in range(work.joints.shape[0] - 1, -1, -1):
        for position in range(layout.joints[j, POSITION] + work.joints[j, COUNT] - 1, layout.joints[j, POSITION] - 1, -1):
            value = values[position] / factor[position, position]
            values[position] = value
            for q in range(layout.joints[j, PRIOR], layout.joints[j + 1, PRIOR]):
                start = layout.joints[layout.prior[q, 0], POSITION]
                for t in range(start, start + work.joints[layout.prior[q, 0], COUNT]):
                    values[t] -= factor[position, t] * value
            for t in range(layout.joints[j, POSITION], position):
                values[t] -= factor[position, t] * value
