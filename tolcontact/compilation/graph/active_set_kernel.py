"""Compiled changes of the active set: in all joints at once, or one by one."""

import numpy as np

from tolcontact.compilation.graph.factor_kernel import (
    add_row,
    append,
    dependence,
    has_position,
    product,
    remove,
    set_row,
    solve,
    squared_length,
)
from tolcontact.compiled import inlined_inner

FEASIBLE = 1e-12  # mm: a row of length 1 is violated if it misses its bound by more
RELIEVED = 1e-14  # times the growth of the entering multiplier: smaller decreases of other multipliers do not block a step
REFINEMENTS = 4
CLOSED = 100  # times the tolerance of rows: slacks may be more negative, since they change a gap by a thousandth of their value
# Results of a step: solved with the active set; the target entered; a blocking row or slack left before; no step is possible.
CHECKED, ENTERED, PARTIAL, STUCK = range(4)


@inlined_inner
def multiply(layout, work):  # type: ignore[no-untyped-def]
    """Compute the multipliers of the active rows, as equations, and the solution; return the largest multiplier."""
    multipliers = work.multiplier
    for j in range(work.counts.size):
        for t in range(layout.first[j], layout.first[j] + work.counts[j]):
            row = work.active[t]
            multipliers[t] = work.bound[row] + product(layout.blocks, work.slopes, row, work.gradient)
            if work.open[j]:
                multipliers[t] += work.opening[row] * work.price[j]
    solve(layout, work, multipliers)
    return move(layout, work)


@inlined_inner
def move(layout, work):  # type: ignore[no-untyped-def]
    """Compute the solution of the multipliers, and return the largest multiplier."""
    for body in range(work.y.shape[0]):
        for c in range(6):
            work.y[body, c] = -work.gradient[body, c]
    largest = 0.0
    for j in range(work.counts.size):
        slack = -work.price[j]
        for t in range(layout.first[j], layout.first[j] + work.counts[j]):
            row, multiplier = work.active[t], work.multiplier[t]
            add_row(layout.blocks, work.slopes, row, multiplier, work.y)
            slack += work.opening[row] * multiplier
            largest = max(largest, abs(multiplier))
        work.value[j] = slack  # for a closed slack, this is its multiplier times -1
    return largest


@inlined_inner
def refine(layout, work):  # type: ignore[no-untyped-def]
    """Refine the multipliers by the residuals of the active rows, while this helps; return the largest residual."""
    missed = np.inf
    for _ in range(REFINEMENTS):
        remainder = 0.0
        for j in range(work.counts.size):
            for t in range(layout.first[j], layout.first[j] + work.counts[j]):
                work.step[t] = -excess(layout, work, work.active[t])
                remainder = max(remainder, abs(work.step[t]))
        helps = remainder > FEASIBLE and remainder < missed / 2
        missed = remainder
        if not helps:
            break
        solve(layout, work, work.step)
        for j in range(work.counts.size):
            for t in range(layout.first[j], layout.first[j] + work.counts[j]):
                work.multiplier[t] += work.step[t]
        move(layout, work)
    return missed


@inlined_inner
def excess(layout, work, row):  # type: ignore[no-untyped-def]
    """Return the value of a row less its bound."""
    j = layout.joint[row]
    value = product(layout.blocks, work.slopes, row, work.y) - work.bound[row]
    if work.open[j]:
        value += work.opening[row] * work.value[j]
    return value


@inlined_inner
def toggle(layout, work, j):  # type: ignore[no-untyped-def]
    """Open the slack of a joint, or close it."""
    work.open[j] = 1 - work.open[j]
    work.fresh[j] = 0
    work.changed[j] = 1


@inlined_inner
def release(layout, work, tolerance):  # type: ignore[no-untyped-def]
    """Drop the row with the most negative multiplier of each joint, and open slacks whose rows push more than their price.

    Return the number of changes.
    """
    changes = 0
    for j in range(work.counts.size):
        if layout.slack[j] < 0:
            continue
        lowest, position = -tolerance, layout.first[j]
        for t in range(layout.first[j], layout.first[j] + work.counts[j]):
            if work.multiplier[t] < lowest:
                lowest, position = work.multiplier[t], t
        if lowest < -tolerance:
            remove(layout, work, position)
            changes += 1
        if not work.open[j] and work.value[j] > tolerance:
            toggle(layout, work, j)
            changes += 1
    return changes


@inlined_inner
def close_slacks(layout, work, tolerance):  # type: ignore[no-untyped-def]
    """Close negative slacks, and return their number."""
    changes = 0
    for j in range(work.counts.size):
        if work.open[j] and work.value[j] < -CLOSED * tolerance:
            toggle(layout, work, j)
            changes += 1
    return changes


@inlined_inner
def scan(layout, work, tolerance, depths, deepest):  # type: ignore[no-untyped-def]
    """Write the most violated row of each joint, or -1, and its excess; return whether any row is violated."""
    violated = False
    for j in range(work.counts.size):
        depths[j], deepest[j] = -tolerance, -1
        if layout.slack[j] < 0:
            continue
        for row in range(layout.row[j], layout.row[j + 1]):
            if work.position[row] < 0:
                value = excess(layout, work, row)
                if value < depths[j]:
                    depths[j], deepest[j], violated = value, row, True
    return violated


@inlined_inner
def most_violated(work, tolerance, depths, deepest):  # type: ignore[no-untyped-def]
    """Return the most violated row, or row count + joint index if the slack of a joint is more negative, or -1 if none is."""
    lowest, target = -tolerance, -1
    for j in range(deepest.size):
        if depths[j] < lowest:
            lowest, target = depths[j], deepest[j]
        if work.open[j] and work.value[j] < min(lowest, -CLOSED * tolerance):
            lowest, target = work.value[j], work.position.size + j
    return target


@inlined_inner
def _aim(layout, work, target):  # type: ignore[no-untyped-def]
    """Compute the direction of y, slacks and multipliers (times -1) as the target enters; return the target's change.

    The change is zero if the target is linearly dependent on the active rows.
    """
    change, scatter, direction = work.step, work.scatter, work.direction
    is_row = target < work.position.size
    joint = layout.joint[target] if is_row else target - work.position.size
    opening, square = 1.0, 0.0
    if is_row:
        set_row(layout.blocks, work.slopes, target, 1.0, scatter)
        opening = work.opening[target]
        square = squared_length(layout.blocks, work.slopes, target)
    for body in range(direction.shape[0]):
        for c in range(6):
            direction[body, c] = scatter[body, c]
    for j in range(work.counts.size):
        work.change[j] = opening if j == joint else 0.0
        for t in range(layout.first[j], layout.first[j] + work.counts[j]):
            change[t] = product(layout.blocks, work.slopes, work.active[t], scatter)
            if work.open[j] and j == joint:
                change[t] += opening * work.opening[work.active[t]]
    solve(layout, work, change)
    for j in range(work.counts.size):
        for t in range(layout.first[j], layout.first[j] + work.counts[j]):
            add_row(layout.blocks, work.slopes, work.active[t], -change[t], direction)
            work.change[j] -= work.opening[work.active[t]] * change[t]
    rate = opening * work.change[joint] if work.open[joint] else 0.0
    if is_row:
        rate += product(layout.blocks, work.slopes, target, direction)
        set_row(layout.blocks, work.slopes, target, 0.0, scatter)
    else:
        # If the slack closes, its rows have the relative pivot of the slack times the square of their openings.
        largest = 0.0
        for t in range(layout.first[joint], layout.first[joint] + work.counts[joint]):
            largest = max(largest, work.opening[work.active[t]] ** 2)
        square = 1.0 / largest if largest > 0.0 else 0.0
    return rate if rate > dependence(work) * square else 0.0


@inlined_inner
def _block(layout, work):  # type: ignore[no-untyped-def]
    """Return the longest step that keeps multipliers nonnegative, and the row or slack that blocks it (see most_violated)."""
    step, blocking = np.inf, -1
    for j in range(work.counts.size):
        if layout.slack[j] < 0:
            continue
        for t in range(layout.first[j], layout.first[j] + work.counts[j]):
            change = work.step[t]
            if change > RELIEVED and work.multiplier[t] < step * change:
                step, blocking = max(work.multiplier[t], 0.0) / change, work.active[t]
        change = work.change[j]
        if not work.open[j] and change > RELIEVED and -work.value[j] < step * change:
            step, blocking = max(-work.value[j], 0.0) / change, work.position.size + j
    return step, blocking


@inlined_inner
def _advance(layout, work, length):  # type: ignore[no-untyped-def]
    """Take a step of this length in the direction of `_aim`."""
    for body in range(work.y.shape[0]):
        for c in range(6):
            work.y[body, c] += length * work.direction[body, c]
    for j in range(work.counts.size):
        work.value[j] += length * work.change[j]
        for t in range(layout.first[j], layout.first[j] + work.counts[j]):
            work.multiplier[t] -= length * work.step[t]


@inlined_inner
def enter_joints(layout, work, deepest):  # type: ignore[no-untyped-def]
    """Activate the most violated row of each joint with a position left, unless a row of the joint has just left."""
    for j in range(deepest.size):
        if deepest[j] >= 0 and not work.changed[j] and has_position(layout, work, j):
            append(layout, work, deepest[j])


@inlined_inner
def step_towards(layout, work, target, growth):  # type: ignore[no-untyped-def]
    """Take the longest step towards activating a row or closing a slack; drop the row or slack that blocks the step.

    Returns ENTERED, PARTIAL or STUCK, and the growth of the target's multiplier.
    """
    rows = work.position.size
    rate = _aim(layout, work, target)
    gap = excess(layout, work, target) if target < rows else work.value[target - rows]
    step, blocking = _block(layout, work)
    whole = -gap / rate if rate > 0.0 else np.inf
    if min(step, whole) == np.inf:
        return STUCK, growth
    _advance(layout, work, min(step, whole))
    growth += min(step, whole)
    if whole <= step:
        if target < rows:
            if not has_position(layout, work, layout.joint[target]):
                return STUCK, growth
            append(layout, work, target)
            work.multiplier[work.position[target]] = growth
        else:
            toggle(layout, work, target - rows)
        return ENTERED, growth
    if blocking < rows:
        remove(layout, work, work.position[blocking])
    else:
        toggle(layout, work, blocking - rows)
    return PARTIAL, growth
