"""Compiled solution of a batch of QPs on the graph of bodies, by a search for the active set.

First in all joints at once: in every joint the most violated row enters, a row with a negative multiplier leaves, and slacks
open and close. If that cycles, one by one: the dual method of Goldfarb and Idnani. Every entering row raises the dual
objective, so that no active set recurs. It starts when no multiplier is negative. Equations are always active, with
multipliers of any sign.
"""

from tolcontact.compilation.graph.active_set_kernel import (
    CHECKED,
    ENTERED,
    FEASIBLE,
    PARTIAL,
    STUCK,
    close_slacks,
    enter_joints,
    excess,
    most_violated,
    multiply,
    refine,
    release,
    scan,
    step_towards,
)
from tolcontact.compilation.graph.factor_kernel import (
    any_open,
    append,
    factorize,
    from_unit,
    has_position,
    load_hessian,
    rows_to_unit,
    vectors_to_unit,
)
from tolcontact.compiled import inlined_inner, uncounted

JOINTS, RELEASE, ROWS = range(3)  # phases: all joints at once; drop rows with negative multipliers; single rows
ATTEMPTS = 3  # of the search by single rows; each starts from the active set at the end of the previous attempt
LOOSENING = 10.0  # factor of the tolerance in every further attempt
ROUNDS_IN_CONFLICT = 6  # of all joints at once: if a slack is open, they usually cycle
ROUNDING = 1e-15  # of the largest multiplier
MAX_ROUNDING = 1e-9  # mm: upper bound of the tolerance
MISSED = 1e-7  # mm: a dependent equation with a larger residual contradicts the others


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


@inlined_inner
def _load(layout, work, problem, k, clears):  # type: ignore[no-untyped-def]
    """Write the rows, bounds, gradient and prices of problem k into `work`; clear its slopes first if `clears`."""
    slopes, gradient, bounds, buffer = problem
    if clears:
        work.slopes[:] = 0.0
    for entry in range(layout.entries.size):
        buffer[layout.entries[entry]] = slopes[k, entry]
    for row in range(layout.joint.size):
        work.bound[row] = bounds[k, layout.source[row]]
        work.position[row] = -1
    bodies = layout.bodies.size
    for body in range(bodies):
        for c in range(6):
            work.gradient[body, c] = gradient[k, 6 * layout.bodies[body] + c]
    for j in range(work.counts.size):
        work.price[j] = gradient[k, 6 * bodies + layout.slack[j]] if layout.slack[j] >= 0 else 0.0
        work.counts[j], work.fresh[j] = 0, 0
        work.changed[j] = 0


@inlined_inner
def _start(layout, work, reactions, slacks, k):  # type: ignore[no-untyped-def]
    """Open the guessed slacks, and activate equations and guessed rows, up to the number of positions."""
    for j in range(work.counts.size):
        slack = layout.slack[j]
        work.open[j] = slack >= 0 and slacks[k, slack] > 0
    for row in range(layout.joint.size):
        j, source = layout.joint[row], layout.source[row]
        if layout.slack[j] < 0 or (reactions[k, source] > 0 and has_position(layout, work, j)):
            append(layout, work, row)


@inlined_inner
def _holds_equations(layout, work):  # type: ignore[no-untyped-def]
    """Return whether the inactive equations hold, which depend on others."""
    for j in range(work.counts.size):
        if layout.slack[j] < 0:
            for row in range(layout.row[j], layout.row[j + 1]):
                if work.position[row] < 0 and abs(excess(layout, work, row)) > MISSED:
                    return False
    return True


@inlined_inner
def _store(layout, work, k, x, lam_a, lam_x):  # type: ignore[no-untyped-def]
    """Write the solution of problem k."""
    bodies = layout.bodies.size
    for body in range(bodies):
        for c in range(6):
            x[k, 6 * layout.bodies[body] + c] = work.y[body, c]
    for j in range(work.counts.size):
        if layout.slack[j] >= 0:
            if work.open[j]:
                x[k, 6 * bodies + layout.slack[j]] = work.value[j]
            else:
                lam_x[k, 6 * bodies + layout.slack[j]] = work.value[j]
        for t in range(layout.first[j], layout.first[j] + work.counts[j]):
            lam_a[k, layout.source[work.active[t]]] = -work.multiplier[t]


@uncounted
def solve_batch(layout, work, hessian, problem, guess, limits, search, answer):  # type: ignore[no-untyped-def]
    """Solve min x'Hx/2 + g'x, a x >= lba; write x, lam_a, lam_x (QP, entry), all zero before, and failed (QP,).

    hessian    nonzeros of h (QP, _), without columns if H is the identity, and a buffer (block, 6, 6)
    problem    nonzeros of a (QP, _), g (QP, n), lba (QP, m), the buffer of the rows
    guess      reactions (QP, row) and slacks (QP, slack) of the previous problem of each realization, or zero
    limits     rounds of all joints at once, steps of single rows
    search     buffers depths (joint,), deepest (joint,) and counters (QP, 2): rounds of joints, attempts by single rows
    """
    x, lam_a, lam_x, failed = answer
    depths, deepest, counters = search
    nonzeros, blocks = hessian
    reactions, slacks = guess
    coupled = nonzeros.shape[1] > 0
    for k in range(x.shape[0]):
        _load(layout, work, problem, k, coupled)
        if coupled:
            if not load_hessian(layout, nonzeros, k, blocks):
                failed[k] = True
                continue
            vectors_to_unit(layout, blocks, work.gradient)
            rows_to_unit(layout, blocks, work.slopes)
        _start(layout, work, reactions, slacks, k)
        if not find_active_rows(layout, work, limits, depths, deepest, counters[k]):
            failed[k] = True
            continue
        refine(layout, work)
        failed[k] = not _holds_equations(layout, work)
        if coupled:
            from_unit(layout, blocks, work.y)
        _store(layout, work, k, x, lam_a, lam_x)
