"""Compiled search for the rows that carry: in all joints at once, and if that goes round, one by one.

At once: in every joint the most violated row starts to carry, a row that pulls carries no longer, and slacks open and close.
One by one: the dual method of Goldfarb and Idnani, which raises the dual objective with every row, so that no set of rows comes
back; it begins when no multiplier is negative. Equations always carry, with multipliers of any sign.
"""

from tolcontact.compilation.graph.active_set_kernel import (
    CHECKED,
    ENTERED,
    FEASIBLE,
    PARTIAL,
    STUCK,
    close_slacks,
    enter_joints,
    most_violated,
    multiply,
    refine,
    release,
    scan,
    step_towards,
)
from tolcontact.compilation.graph.factor_kernel import any_open, factorize
from tolcontact.compiled import inlined_inner

JOINTS, RELEASE, ROWS = range(3)  # phases: all joints at once; drop rows that pull; single rows
ATTEMPTS = 3  # of the search for single rows, each from what the attempt before it ended with
LOOSER = 10.0  # by which rows may be violated more in every further attempt
ROUNDS_IN_CONFLICT = 6  # of all joints at once: where a slack is open, they mostly go round
ROUNDING = 1e-15  # of the largest multiplier
COARSE = 1e-9  # mm: most that counts as rounding


@inlined_inner
def _tolerance(layout, work, refines):  # type: ignore[no-untyped-def]
    """Solve with the rows that carry as equations, and return the violation [mm] up to which other rows hold."""
    largest = multiply(layout, work)
    missed = refine(layout, work) if refines or any_open(work) else 0.0
    return min(FEASIBLE + ROUNDING * largest + 2 * missed, COARSE)


@inlined_inner
def _update_joints(layout, work, tolerance, depths, deepest):  # type: ignore[no-untyped-def]
    """Let rows enter and leave in all joints at once; return whether the solution is reached."""
    changes = release(layout, work, tolerance) + close_slacks(layout, work, tolerance)
    if not scan(layout, work, tolerance, depths, deepest):
        return changes == 0
    enter_joints(layout, work, deepest)
    return False


@inlined_inner
def _enter_row(layout, work, tolerance, depths, deepest, state):  # type: ignore[no-untyped-def]
    """Take a step towards the most violated row; return whether none is violated. `state` is the result, target and growth."""
    result, target, growth = state
    if result != PARTIAL:
        scan(layout, work, tolerance, depths, deepest)
        target, growth = most_violated(work, tolerance, depths, deepest), 0.0
        if target < 0:
            return result == CHECKED, (CHECKED, target, growth)
    result, growth = step_towards(layout, work, target, growth)
    # What steps add up to is precise, unless open slacks hold rows weakly.
    if result == ENTERED and any_open(work):
        result = CHECKED
    return False, (result, target, growth)


@inlined_inner
def find_active_rows(layout, work, limits, depths, deepest, counters):  # type: ignore[no-untyped-def]
    """Find the rows that carry, and return whether they were found.

    limits            rounds of all joints at once, steps of single rows in an attempt
    depths, deepest   (joint,) buffers
    counters          (2,) rounds of all joints, attempts by single rows
    """
    phase, steps, looseness = JOINTS if limits[0] > 0 else RELEASE, 0, 1.0
    state = CHECKED, deepest.size, 0.0
    while counters[1] <= ATTEMPTS:
        if factorize(layout, work) and phase == ROWS:
            phase = RELEASE
        if phase != ROWS or state[0] == CHECKED:
            tolerance = _tolerance(layout, work, phase == ROWS) * looseness
        if phase == JOINTS:
            counters[0] += 1
            if _update_joints(layout, work, tolerance, depths, deepest):
                return True
            if counters[0] >= limits[0] or (counters[0] >= ROUNDS_IN_CONFLICT and any_open(work)):
                phase = RELEASE
        elif phase == RELEASE:
            if not release(layout, work, 0.0):
                phase, steps, looseness = ROWS, 0, LOOSER ** counters[1]
                state = CHECKED, deepest.size, 0.0
                counters[1] += 1
        else:
            holds, state = _enter_row(layout, work, tolerance, depths, deepest, state)
            if holds:
                return True
            steps += 1
            if steps == limits[1] or state[0] == STUCK:
                phase = RELEASE
    return False
