"""Compiled search for the active set: in all joints at once, and if that cycles, one by one.

At once: in every joint the most violated row enters, a row with a negative multiplier leaves, and slacks open and close.
One by one: the dual method of Goldfarb and Idnani. Every entering row raises the dual objective, so that no active set recurs.
It starts when no multiplier is negative. Equations are always active, with multipliers of any sign.
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

JOINTS, RELEASE, ROWS = range(3)  # phases: all joints at once; drop rows with negative multipliers; single rows
ATTEMPTS = 3  # of the search by single rows; each starts from the active set at the end of the previous attempt
LOOSENING = 10.0  # factor of the tolerance in every further attempt
ROUNDS_IN_CONFLICT = 6  # of all joints at once: if a slack is open, they usually cycle
ROUNDING = 1e-15  # of the largest multiplier
MAX_ROUNDING = 1e-9  # mm: upper bound of the tolerance


@inlined_inner
def _tolerance(layout, work, refines):  # type: ignore[no-untyped-def]
    """Solve with the active rows as equations, and return the largest violation [mm] of a row that counts as satisfied."""
    largest = multiply(layout, work)
    missed = refine(layout, work) if refines or any_open(work) else 0.0
    return min(FEASIBLE + ROUNDING * largest + 2 * missed, MAX_ROUNDING)


@inlined_inner
def _update_joints(layout, work, tolerance, depths, deepest):  # type: ignore[no-untyped-def]
    """Update the active set in all joints at once; return whether the solution is reached."""
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
    # The sum of the steps is accurate, unless open slacks make rows nearly dependent.
    if result == ENTERED and any_open(work):
        result = CHECKED
    return False, (result, target, growth)


@inlined_inner
def find_active_rows(layout, work, limits, depths, deepest, counters):  # type: ignore[no-untyped-def]
    """Find the active rows, and return whether the search succeeded.

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
                phase, steps, looseness = ROWS, 0, LOOSENING ** counters[1]
                state = CHECKED, deepest.size, 0.0
                counters[1] += 1
        else:
            is_solved, state = _enter_row(layout, work, tolerance, depths, deepest, state)
            if is_solved:
                return True
            steps += 1
            if steps == limits[1] or state[0] == STUCK:
                phase = RELEASE
    return False
