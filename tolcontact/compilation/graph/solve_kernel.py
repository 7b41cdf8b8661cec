"""Compiled solution of a batch of independent QPs on the graph of bodies."""

from tolcontact.compilation.graph.active_set_kernel import excess, refine
from tolcontact.compilation.graph.factor_kernel import (
    BOUND,
    CHANGED,
    COUNT,
    FRESH,
    GRADIENT,
    MULTIPLIER,
    OPEN,
    PRICE,
    VALUE,
    Y,
    append,
    has_position,
)
from tolcontact.compilation.graph.hessian_kernel import from_unit, load_hessian, rows_to_unit, vectors_to_unit
from tolcontact.compilation.graph.layout import JOINT, POSITION, ROW, SLACK, SOURCE
from tolcontact.compilation.graph.search_kernel import find_active_rows
from tolcontact.compiled import inlined_inner, uncounted

MISSED = 1e-7  # mm: a dependent equation with a larger residual contradicts the others


@inlined_inner
def _load(layout, storage, work, problem, k, clears):  # type: ignore[no-untyped-def]
    """Write the rows, bounds, gradient and prices of problem k into `work`; clear its slopes first if `clears`."""
    slopes, gradient, bounds, buffer = problem
    if clears:
        work.slopes[:] = 0.0
    for entry in range(storage.entries.size):
        buffer[storage.entries[entry]] = slopes[k, entry]
    for row in range(layout.rows.shape[0]):
        work.rows[row, BOUND] = bounds[k, layout.rows[row, SOURCE]]
        work.position[row] = -1
    bodies = storage.bodies.size
    for body in range(bodies):
        for c in range(6):
            work.vectors[GRADIENT, body, c] = gradient[k, 6 * storage.bodies[body] + c]
    for j in range(work.joints.shape[0]):
        work.slacks[PRICE, j] = gradient[k, 6 * bodies + layout.joints[j, SLACK]] if layout.joints[j, SLACK] >= 0 else 0.0
        work.joints[j, COUNT], work.joints[j, FRESH] = 0, 0
        work.joints[j, CHANGED] = 0


@inlined_inner
def _start(layout, work, reactions, slacks, k):  # type: ignore[no-untyped-def]
    """Open the guessed slacks, and activate equations and guessed rows, up to the number of positions."""
    for j in range(work.joints.shape[0]):
        slack = layout.joints[j, SLACK]
        work.joints[j, OPEN] = slack >= 0 and slacks[k, slack] > 0
    for row in range(layout.rows.shape[0]):
        j, source = layout.rows[row, JOINT], layout.rows[row, SOURCE]
        if layout.joints[j, SLACK] < 0 or (reactions[k, source] > 0 and has_position(layout, work, j)):
            append(layout, work, row)


@inlined_inner
def _holds_equations(layout, work):  # type: ignore[no-untyped-def]
    """Return whether the inactive equations hold, which depend on others."""
    for j in range(work.joints.shape[0]):
        if layout.joints[j, SLACK] < 0:
            for row in range(layout.joints[j, ROW], layout.joints[j + 1, ROW]):
                if work.position[row] < 0 and abs(excess(layout, work, row)) > MISSED:
                    return False
    return True


@inlined_inner
def _store(layout, storage, work, k, x, lam_a, lam_x):  # type: ignore[no-untyped-def]
    """Write the solution of problem k."""
    bodies = storage.bodies.size
    for body in range(bodies):
        for c in range(6):
            x[k, 6 * storage.bodies[body] + c] = work.vectors[Y, body, c]
    for j in range(work.joints.shape[0]):
        if layout.joints[j, SLACK] >= 0:
            if work.joints[j, OPEN]:
                x[k, 6 * bodies + layout.joints[j, SLACK]] = work.slacks[VALUE, j]
            else:
                lam_x[k, 6 * bodies + layout.joints[j, SLACK]] = work.slacks[VALUE, j]
        for t in range(layout.joints[j, POSITION], layout.joints[j, POSITION] + work.joints[j, COUNT]):
            lam_a[k, layout.rows[work.active[t], SOURCE]] = -work.positions[MULTIPLIER, t]


@uncounted
def solve_batch(layout, storage, work, hessian, problem, guess, limits, search, answer):  # type: ignore[no-untyped-def]
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
        _load(layout, storage, work, problem, k, coupled)
        if coupled:
            if not load_hessian(storage, nonzeros, k, blocks):
                failed[k] = True
                continue
            vectors_to_unit(storage, blocks, work.vectors[GRADIENT])
            rows_to_unit(layout.blocks, storage, blocks, work.slopes)
        _start(layout, work, reactions, slacks, k)
        if not find_active_rows(layout, work, limits, depths, deepest, counters[k]):
            failed[k] = True
            continue
        refine(layout, work)
        failed[k] = not _holds_equations(layout, work)
        if coupled:
            from_unit(storage, blocks, work.vectors[Y])
        _store(layout, storage, work, k, x, lam_a, lam_x)
