"""Compiled search for the rows that carry: by joints, all at once, and if that goes round, one by one.

All at once: in every joint the most violated row starts to carry, a row that pulls carries no longer, and slacks open and
close. One by one: the dual method of Goldfarb and Idnani, which raises the dual objective with every row, so that no set of
rows comes back. Equations always carry, with multipliers of any sign.
"""

import numpy as np

from tolcontact.compilation.graph.factor_kernel import (
    add_row,
    append,
    factorize,
    product,
    remove,
    set_row,
    solve,
    squared_length,
)
from tolcontact.compiled import inlined_uncounted, uncounted

FEASIBLE = 1e-12  # mm: rows of length 1 are violated by more
ROUNDING = 1e-15  # of the largest multiplier
INDEPENDENT = 1e-11  # of the square of a row: what remains of it beside the rows that carry
EAGER_ROUNDS = 3  # afterwards, a row only enters if no row of a neighbouring joint is violated by more


@uncounted
def multiply(layout, work):  # type: ignore[no-untyped-def]
    """Compute the multipliers of the rows that carry, as equations, and the solution; return the largest multiplier."""
    positions, counts, multipliers = layout.positions, work.counts, work.multipliers
    for j in range(counts.size):
        for t in range(positions[j], positions[j] + counts[j]):
            row = work.carrying[t]
            multipliers[t] = work.bounds[row] + product(layout, work.slopes, row, work.gradient)
            if work.is_open[j]:
                multipliers[t] += work.openings[row] * work.prices[j]
    solve(layout, work, multipliers)
    return _move(layout, work)


@uncounted
def _move(layout, work):  # type: ignore[no-untyped-def]
    """Compute the solution of the multipliers, and return the largest multiplier."""
    for body in range(work.y.shape[0]):
        for c in range(6):
            work.y[body, c] = -work.gradient[body, c]
    largest = 0.0
    for j in range(work.counts.size):
        pull = -work.prices[j]
        for t in range(layout.positions[j], layout.positions[j] + work.counts[j]):
            row, multiplier = work.carrying[t], work.multipliers[t]
            add_row(layout, work.slopes, row, multiplier, work.y)
            pull += work.openings[row] * multiplier
            largest = max(largest, abs(multiplier))
        work.slack[j] = pull  # of a closed slack: its multiplier, with the other sign
    return largest


@uncounted
def refine(layout, work):  # type: ignore[no-untyped-def]
    """Correct the multipliers by what the rows that carry miss their bounds by."""
    for j in range(work.counts.size):
        for t in range(layout.positions[j], layout.positions[j] + work.counts[j]):
            work.right_side[t] = -excess(layout, work, work.carrying[t])
    solve(layout, work, work.right_side)
    for j in range(work.counts.size):
        for t in range(layout.positions[j], layout.positions[j] + work.counts[j]):
            work.multipliers[t] += work.right_side[t]
    _move(layout, work)


@inlined_uncounted
def excess(layout, work, row):  # type: ignore[no-untyped-def]
    """Return by how much a row exceeds its bound."""
    j = layout.joint[row]
    value = product(layout, work.slopes, row, work.y) - work.bounds[row]
    if work.is_open[j]:
        value += work.openings[row] * work.slack[j]
    return value


@uncounted
def set_open(layout, work, j, is_open):  # type: ignore[no-untyped-def]
    """Open or close the slack of a joint."""
    work.is_open[j] = is_open
    work.fresh[j] = 0
    work.changed[j] = True


@uncounted
def release(layout, work, tolerance, closes):  # type: ignore[no-untyped-def]
    """Drop the row of each joint that pulls most, open slacks whose price is too low, and close negative ones.

    Returns the number of changes. Without `closes`, negative slacks stay open.
    """
    changes = 0
    for j in range(work.counts.size):
        if layout.slack[j] < 0:
            continue
        lowest, position = -tolerance, -1
        for t in range(layout.positions[j], layout.positions[j] + work.counts[j]):
            if work.multipliers[t] < lowest:
                lowest, position = work.multipliers[t], t
        if position >= 0:
            remove(layout, work, position)
            changes += 1
        if not work.is_open[j] and work.slack[j] > tolerance:
            set_open(layout, work, j, True)
            changes += 1
        elif closes and work.is_open[j] and work.slack[j] < -tolerance:
            set_open(layout, work, j, False)
            changes += 1
    return changes


@uncounted
def scan(layout, work, tolerance, depths, deepest):  # type: ignore[no-untyped-def]
    """Write the most violated row of each joint, or -1, and its excess; return whether there is one."""
    violated = False
    for j in range(work.counts.size):
        depths[j], deepest[j] = -tolerance, -1
        if layout.slack[j] < 0:
            continue
        for row in range(layout.row_starts[j], layout.row_starts[j + 1]):
            if work.place[row] < 0:
                value = excess(layout, work, row)
                if value < depths[j]:
                    depths[j], deepest[j], violated = value, row, True
    return violated


@uncounted
def search_joints(layout, work, rounds, depths, deepest):  # type: ignore[no-untyped-def]
    """Let rows enter and leave in all joints at once; return the rounds that this took, or -1 if there is no end."""
    for number in range(rounds):
        factorize(layout, work)
        tolerance = FEASIBLE + ROUNDING * multiply(layout, work)
        if release(layout, work, tolerance, True):
            continue
        if not scan(layout, work, tolerance, depths, deepest):
            return number + 1
        for j in range(deepest.size):
            enters = deepest[j] >= 0
            if number >= EAGER_ROUNDS:
                for q in range(layout.near_starts[j], layout.near_starts[j + 1]):
                    k = layout.near[q]
                    enters = enters and (depths[k] > depths[j] or (depths[k] == depths[j] and k > j))
            if enters:
                append(layout, work, deepest[j])
    return -1


@uncounted
def make_dual_feasible(layout, work):  # type: ignore[no-untyped-def]
    """Drop rows and open slacks until no multiplier is negative."""
    while True:
        factorize(layout, work)
        multiply(layout, work)
        if not release(layout, work, 0.0, False):
            return


@uncounted
def search_rows(layout, work, steps, depths, deepest):  # type: ignore[no-untyped-def]
    """Let rows enter one by one, from multipliers that are not negative; return whether none is violated in the end."""
    tolerance = FEASIBLE + ROUNDING * multiply(layout, work)
    while steps > 0:
        scan(layout, work, tolerance, depths, deepest)
        lowest, row, closing = -tolerance, -1, -1
        for j in range(deepest.size):
            if depths[j] < lowest:
                lowest, row, closing = depths[j], deepest[j], -1
            if work.is_open[j] and work.slack[j] < lowest:
                lowest, row, closing = work.slack[j], -1, j
        if row < 0 and closing < 0:
            return True
        used = _enter(layout, work, row, closing, steps)
        if used == 0:
            return False
        steps -= used
        factorize(layout, work)
        tolerance = FEASIBLE + ROUNDING * multiply(layout, work)
    return False


@uncounted
def _aim(layout, work, row, closing):  # type: ignore[no-untyped-def]
    """Compute the direction in which the multiplier of a row grows, or of a slack that closes: of y, slacks and multipliers."""
    change = work.right_side
    target = layout.joint[row] if row >= 0 else closing
    opening = work.openings[row] if row >= 0 else 1.0
    if row >= 0:
        set_row(layout, work.slopes, row, 1.0, work.scatter)
    for body in range(work.direction.shape[0]):
        for c in range(6):
            work.direction[body, c] = work.scatter[body, c]
    for j in range(work.counts.size):
        work.slack_direction[j] = opening if j == target else 0.0
        for t in range(layout.positions[j], layout.positions[j] + work.counts[j]):
            change[t] = product(layout, work.slopes, work.carrying[t], work.scatter)
            if work.is_open[j] and j == target:
                change[t] += opening * work.openings[work.carrying[t]]
    if row >= 0:
        set_row(layout, work.slopes, row, 0.0, work.scatter)
    solve(layout, work, change)
    for j in range(work.counts.size):
        for t in range(layout.positions[j], layout.positions[j] + work.counts[j]):
            add_row(layout, work.slopes, work.carrying[t], -change[t], work.direction)
            work.slack_direction[j] -= work.openings[work.carrying[t]] * change[t]


@uncounted
def _block(layout, work):  # type: ignore[no-untyped-def]
    """Return the longest step that leaves multipliers not negative, the position of the row that stops it, and the joint."""
    step, position, joint = np.inf, -1, -1
    for j in range(work.counts.size):
        if layout.slack[j] < 0:
            continue
        for t in range(layout.positions[j], layout.positions[j] + work.counts[j]):
            change = work.right_side[t]
            if change > 1e-14 and work.multipliers[t] < step * change:
                step, position, joint = max(work.multipliers[t], 0.0) / change, t, -1
        # The slack of a closed joint, with the other sign, is the multiplier of its bound.
        change = work.slack_direction[j]
        if not work.is_open[j] and change > 1e-14 and -work.slack[j] < step * change:
            step, position, joint = max(-work.slack[j], 0.0) / change, -1, j
    return step, position, joint


@uncounted
def _advance(layout, work, length):  # type: ignore[no-untyped-def]
    """Take a step of this length in the direction of `_aim`."""
    for body in range(work.y.shape[0]):
        for c in range(6):
            work.y[body, c] += length * work.direction[body, c]
    for j in range(work.counts.size):
        work.slack[j] += length * work.slack_direction[j]
        for t in range(layout.positions[j], layout.positions[j] + work.counts[j]):
            work.multipliers[t] -= length * work.right_side[t]


@uncounted
def _enter(layout, work, row, closing, steps):  # type: ignore[no-untyped-def]
    """Let a row carry, or close a slack, and drop what this relieves; return the number of steps, 0 without success."""
    for number in range(steps):
        _aim(layout, work, row, closing)
        if row >= 0:
            j = layout.joint[row]
            gap, opening = excess(layout, work, row), work.openings[row] if work.is_open[j] else 0.0
            rate = product(layout, work.slopes, row, work.direction) + opening * work.slack_direction[j]
            square = squared_length(layout, work.slopes, row)
        else:
            gap, rate, square = work.slack[closing], work.slack_direction[closing], 1.0
        step, position, joint = _block(layout, work)
        whole = -gap / rate if rate > INDEPENDENT * square else np.inf
        length = min(step, whole)
        if length == np.inf:
            return 0
        _advance(layout, work, length)
        if whole <= step:
            if row >= 0:
                append(layout, work, row)
            else:
                set_open(layout, work, closing, False)
            return number + 1
        if position >= 0:
            remove(layout, work, position)
        else:
            set_open(layout, work, joint, True)
        if factorize(layout, work):
            return 0
    return 0
