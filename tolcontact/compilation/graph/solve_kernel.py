"""Compiled solution of a batch of QPs on the graph of bodies, each from its data alone."""

from tolcontact.compilation.graph.active_set_kernel import (
    excess,
    make_dual_feasible,
    refine,
    search_joints,
    search_rows,
)
from tolcontact.compilation.graph.factor_kernel import append
from tolcontact.compilation.graph.hessian_kernel import from_unit, load_hessian, rows_to_unit, vectors_to_unit
from tolcontact.compiled import uncounted

ATTEMPTS = 3  # of the search for single rows, each from what the attempt before it ended with
MISSED = 1e-7  # mm: an equation that depends on others and is missed by more contradicts them


@uncounted
def _load(layout, work, problem, k, clears):  # type: ignore[no-untyped-def]
    """Write the rows, bounds, gradient and prices of problem k into `work`, which is cleared if rows fill more of it."""
    slopes, gradient, bounds, buffer = problem
    if clears:
        work.slopes[:] = 0.0
    for entry in range(layout.entries.size):
        buffer[layout.entries[entry]] = slopes[k, entry]
    for row in range(layout.row_order.size):
        work.bounds[row] = bounds[k, layout.row_order[row]]
        work.place[row] = -1
    bodies = layout.body_order.size
    for body in range(bodies):
        for c in range(6):
            work.gradient[body, c] = gradient[k, 6 * layout.body_order[body] + c]
    for j in range(layout.slack.size):
        work.prices[j] = gradient[k, 6 * bodies + layout.slack[j]] if layout.slack[j] >= 0 else 0.0
        work.counts[j], work.fresh[j] = 0, 0
        work.changed[j], work.is_open[j] = False, False


@uncounted
def _start(layout, work, reactions, k):  # type: ignore[no-untyped-def]
    """Let equations carry, and the rows that carried before, as far as there are positions."""
    for row in range(layout.row_order.size):
        j, source = layout.joint[row], layout.row_order[row]
        has_position = layout.positions[j] + work.counts[j] < layout.positions[j + 1]
        if layout.slack[j] < 0 or (reactions[k, source] > 0 and has_position):
            append(layout, work, row)


@uncounted
def _search(layout, work, rounds, steps, depths, deepest, counters, k):  # type: ignore[no-untyped-def]
    """Find the rows that carry, and return whether they were found."""
    counters[k, 0] = search_joints(layout, work, rounds, depths, deepest)
    if counters[k, 0] >= 0:
        return True
    for attempt in range(ATTEMPTS):
        counters[k, 1] = attempt + 1
        make_dual_feasible(layout, work)
        if search_rows(layout, work, steps, depths, deepest):
            return True
    return False


@uncounted
def _holds_equations(layout, work):  # type: ignore[no-untyped-def]
    """Return whether equations hold that do not carry, since they depend on others."""
    for j in range(layout.slack.size):
        if layout.slack[j] < 0:
            for row in range(layout.row_starts[j], layout.row_starts[j + 1]):
                if work.place[row] < 0 and abs(excess(layout, work, row)) > MISSED:
                    return False
    return True


@uncounted
def _store(layout, work, k, x, lam_a, lam_x):  # type: ignore[no-untyped-def]
    """Write the solution of problem k."""
    bodies = layout.body_order.size
    for body in range(bodies):
        for c in range(6):
            x[k, 6 * layout.body_order[body] + c] = work.y[body, c]
    for j in range(layout.slack.size):
        if layout.slack[j] >= 0:
            if work.is_open[j]:
                x[k, 6 * bodies + layout.slack[j]] = work.slack[j]
            else:
                lam_x[k, 6 * bodies + layout.slack[j]] = work.slack[j]
        for t in range(layout.positions[j], layout.positions[j] + work.counts[j]):
            lam_a[k, layout.row_order[work.carrying[t]]] = -work.multipliers[t]


@uncounted
def solve_batch(layout, work, hessian, problem, reactions, limits, search, answer):  # type: ignore[no-untyped-def]
    """Solve min x'Hx/2 + g'x, a x >= lba; write x, lam_a, lam_x (QP, entry), all zero before, and failed (QP,).

    hessian    nonzeros of h (QP, _), without columns if H is the identity, and buffers (block, 6, 6), (body, body)
    problem    nonzeros of a (QP, _), g (QP, n), lba (QP, m), the buffer of the rows
    reactions  (QP, row) of the previous problem of each realization, or zero
    limits     rounds of all joints at once, steps of single rows
    search     buffers depths (joint,), deepest (joint,) and counters (QP, 2): rounds of joints or -1, attempts by single rows
    """
    x, lam_a, lam_x, failed = answer
    depths, deepest, counters = search
    nonzeros, blocks, block_of = hessian
    coupled = nonzeros.shape[1] > 0
    for k in range(x.shape[0]):
        _load(layout, work, problem, k, coupled)
        if coupled:
            if not load_hessian(layout, nonzeros, k, blocks, block_of):
                failed[k] = True
                continue
            vectors_to_unit(layout, blocks, work.gradient)
            rows_to_unit(layout, blocks, block_of, work.slopes)
        _start(layout, work, reactions, k)
        if not _search(layout, work, limits[0], limits[1], depths, deepest, counters, k):
            failed[k] = True
            continue
        refine(layout, work)
        failed[k] = not _holds_equations(layout, work)
        if coupled:
            from_unit(layout, blocks, work.y)
        _store(layout, work, k, x, lam_a, lam_x)
