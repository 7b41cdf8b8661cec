"""Compiled solution of contact QPs of elastic parts in the reactions alone: many rows, few movers, a full flexibility.

    min x'H x / 2 + g'x + l'C l / 2   with the gaps   s = A x + C l + b >= 0,   H x + g = A'l,   l >= 0,   l's = 0

Without x, these are the conditions of min l'W l / 2 + q'l, l >= 0, with W = A H^-1 A' + C and q = b - A H^-1 g. Equations have
s = 0 and reactions of either sign. Only the columns of W at active rows are computed. First, all rows that pull leave the
active set and all that penetrate enter it at once; most QPs are solved after a few such rounds. If these do not end, a dual
method (Goldfarb and Idnani 1983) continues, row by row: it ends, and finds QPs without a solution.
"""

import numpy as np

from tolcontact.compilation.row_factor_kernel import (
    ROUNDING,
    append_row,
    back_substitute,
    flexibility_between,
    forward_substitute,
    remove_row,
)
from tolcontact.compiled import compiled, inner

SOLVED, INFEASIBLE, UNFINISHED = 0, 1, 2
MAX_ROUNDS, PATIENCE = 30, 4  # rounds in all, and rounds in which the number of wrong rows may not fall
SHALLOW = 0.5  # of the deepest penetration: shallower rows wait, since most of them come free when deeper ones push
FEW_ROWS = 6  # that may enter in any round
STEPS_PER_ROW = 10


@compiled
def solve_dual(H, g, A, b, C, equations, guess, tolerance, x, reactions, status):  # type: ignore[no-untyped-def]
    """Write x (QP, n), reactions (QP, row) and the status (QP,) of QPs, one of SOLVED, INFEASIBLE, UNFINISHED.

    If a QP is infeasible, its reactions are a ray: they change no gap, and their work on the gaps is negative.


    H, g        (QP, n, n) positive definite, and (QP, n)
    A, b        (QP, row, n) and (QP, row): gaps [mm] without reactions
    C           (row, row): flexibility [mm/N], symmetric and positive semidefinite
    equations   number of the last rows that are equations
    guess       (QP, row): rows with positive reactions are probably active
    tolerance   [mm]: a row penetrates if its gap is below -tolerance
    """
    count, rows, size = A.shape
    B, L, q, v, u = np.empty((size, rows)), np.empty((size, size)), np.empty(rows), np.empty(size), np.empty(size)
    gaps, factor, y = np.empty(rows), np.empty((rows, rows)), np.empty(rows)
    active, is_active, best = np.empty(rows, np.int64), np.empty(rows, np.bool_), np.empty(rows, np.bool_)
    first = rows - equations
    for k in range(count):
        _reduce(H[k], g[k], A[k], b[k], L, v, B, q)
        for i in range(rows):
            is_active[i] = i >= first or guess[k, i] > 0
        work = (B, C, q, gaps, reactions[k], factor, y, active, is_active, first, tolerance, b[k], v, u)
        status[k] = SOLVED if _exchange(work, best) else _dual_steps(work)
        _mover_motion(L, u, x[k])


@inner
def _reduce(H, g, A, b, L, v, B, q):  # type: ignore[no-untyped-def]
    """Write the factor L of H, v = L^-1 g, B = L^-1 A' and q = b - B'v: then W = B'B + C."""
    size = len(g)
    for i in range(size):
        for j in range(i + 1):
            total = H[i, j]
            for c in range(j):
                total -= L[i, c] * L[j, c]
            L[i, j] = np.sqrt(total) if i == j else total / L[j, j]
        total = g[i]
        for c in range(i):
            total -= L[i, c] * v[c]
        v[i] = total / L[i, i]
    for row in range(len(b)):
        q[row] = b[row]
    for j in range(size):
        for row in range(len(b)):
            B[j, row] = A[row, j]
        for c in range(j):
            for row in range(len(b)):
                B[j, row] -= B[c, row] * L[j, c]
        for row in range(len(b)):
            B[j, row] /= L[j, j]
            q[row] -= B[j, row] * v[j]


@inner
def _mover_motion(L, u, x):  # type: ignore[no-untyped-def]
    """Write x = L^-T u."""
    size = len(u)
    for c in range(size):
        x[c] = u[c]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            x[i] -= L[j, i] * x[j]
        x[i] /= L[i, i]


@inner
def _solve_active(work, k):  # type: ignore[no-untyped-def]
    """Write the reactions that close k active rows, and all gaps; return the tolerance, or what rounding makes of it."""
    q, reactions, factor, y, active = work[2], work[4], work[5], work[6], work[7]
    for i in range(len(q)):
        reactions[i] = 0.0
    for j in range(k):
        y[j] = -q[active[j]]
    forward_substitute(factor, k, y)
    back_substitute(factor, k, y)
    for j in range(k):
        reactions[active[j]] = y[j]
    return _write_gaps(work, k)


@inner
def _refine(work, k):  # type: ignore[no-untyped-def]
    """Close what rounding has left of the gaps of k active rows, and return the tolerance.

    Reactions that balance large forces leave rounding in u, which the gaps contain. So u and the reactions change together.
    """
    B, C, gaps, reactions, factor, y, active, u = work[0], work[1], work[3], work[4], work[5], work[6], work[7], work[13]
    for j in range(k):
        y[j] = -gaps[active[j]]
    forward_substitute(factor, k, y)
    back_substitute(factor, k, y)
    terms = 0.0
    for j in range(k):
        row = active[j]
        reactions[row] += y[j]
        terms += abs(reactions[row]) * C[row, row]
        for c in range(len(B)):
            u[c] += B[c, row] * y[j]
    _write_gaps_of(work, k)
    return max(work[10], 4.0 * ROUNDING * terms)


@inner
def _write_gaps(work, k):  # type: ignore[no-untyped-def]
    """Write u = B l - v and the gaps of all rows for k active ones, and return the tolerance, or what rounding makes of it."""
    B, C, reactions, active, v, u = work[0], work[1], work[4], work[7], work[12], work[13]
    terms = 0.0
    for c in range(len(B)):
        total = -v[c]
        for j in range(k):
            total += B[c, active[j]] * reactions[active[j]]
        u[c] = total
    for j in range(k):
        terms += abs(reactions[active[j]]) * flexibility_between(B, C, active[j], active[j])
    _write_gaps_of(work, k)
    return max(work[10], 4.0 * ROUNDING * terms)


@inner
def _write_gaps_of(work, k):  # type: ignore[no-untyped-def]
    """Write the gaps B'u + C l + b of all rows for k active ones."""
    B, C, gaps, reactions, active, b, u = work[0], work[1], work[3], work[4], work[7], work[11], work[13]
    for i in range(len(b)):
        gaps[i] = b[i]
    for j in range(k):
        value, column = reactions[active[j]], C[active[j]]
        for i in range(len(b)):
            gaps[i] += value * column[i]
    for c in range(len(B)):
        value = u[c]
        for i in range(len(b)):
            gaps[i] += B[c, i] * value


@inner
def _exchange(work, best):  # type: ignore[no-untyped-def]
    """Exchange all wrong rows at once until none is left, and return whether that succeeds; else keep the best active set."""
    reactions, active, is_active, first = work[4], work[7], work[8], work[9]
    rows, kept = len(reactions), 0
    fewest, patience = rows + 1, PATIENCE
    for _ in range(MAX_ROUNDS):
        k = _extended(work, kept)
        tolerance = _solve_active(work, k)
        wrong = _wrong_rows(work, tolerance)
        if wrong == 0:
            tolerance = _refine(work, k)
            wrong = _wrong_rows(work, tolerance)
        if wrong == 0:
            return True
        if wrong < fewest:
            fewest, patience = wrong, PATIENCE
            for row in range(rows):
                best[row] = is_active[row]
        else:
            patience -= 1
            if patience == 0:
                break
        kept = k
        _mark_penetrating(work, k, tolerance)
        for j in range(k - 1, -1, -1):
            if active[j] < first and reactions[active[j]] < 0:
                is_active[active[j]] = False
                kept = j
    for row in range(rows):
        is_active[row] = best[row]
    return False


@inner
def _extended(work, kept):  # type: ignore[no-untyped-def]
    """Append the active rows that are not among the `kept` ones, equations first, and return how many are independent."""
    active, is_active = work[7], work[8]
    for j in range(kept):
        is_active[active[j]] = False  # for a moment
    k = kept
    for row in range(len(is_active) - 1, -1, -1):
        if is_active[row]:
            is_active[row] = append_row(work, k, row)
            if is_active[row]:
                active[k] = row
                k += 1
    for j in range(kept):
        is_active[active[j]] = True
    return k


@inner
def _wrong_rows(work, tolerance):  # type: ignore[no-untyped-def]
    """Return the number of active rows that pull, and of other rows that penetrate, or are equations with a gap."""
    gaps, reactions, is_active, first = work[3], work[4], work[8], work[9]
    wrong = 0
    for row in range(len(gaps)):
        if is_active[row]:
            wrong += row < first and reactions[row] < 0
        else:
            wrong += gaps[row] < -tolerance or (row >= first and gaps[row] > tolerance)
    return wrong


@inner
def _mark_penetrating(work, k, tolerance):  # type: ignore[no-untyped-def]
    """Activate equations, and the rows that penetrate deepest: near the deepest one, and not many for k active ones.

    From no active row at all, a force moves all rows far into their counterparts, and each of them would enter.
    """
    gaps, is_active, first = work[3], work[8], work[9]
    deepest = -tolerance
    for row in range(first):
        if not is_active[row]:
            deepest = min(deepest, gaps[row])
    share, count = SHALLOW, len(gaps)
    while count > FEW_ROWS + k // 2 and share < 1.0 - 1e-9:
        count = 0
        for row in range(first):
            count += not is_active[row] and gaps[row] < min(share * deepest, -tolerance)
        share += 0.5 * (1.0 - share) if count > FEW_ROWS + k // 2 else 0.0
    for row in range(len(gaps)):
        if not is_active[row]:
            is_active[row] = row >= first or gaps[row] < min(share * deepest, -tolerance)


@inner
def _feasible_start(work):  # type: ignore[no-untyped-def]
    """Activate independent rows, and drop those that pull most until none does; return how many remain."""
    reactions, active, is_active, first = work[4], work[7], work[8], work[9]
    is_active[first:] = True
    k = _extended(work, 0)
    while True:
        _solve_active(work, k)
        worst = -1
        for j in range(k):
            row = active[j]
            if row < first and reactions[row] < 0 and (worst < 0 or reactions[row] < reactions[active[worst]]):
                worst = j
        if worst < 0:
            return k
        remove_row(work, k, worst)
        k -= 1


@inner
def _dual_steps(work):  # type: ignore[no-untyped-def]
    """Activate the row that penetrates most, until none does, and return the status; rows whose reactions reach 0 leave."""
    gaps, reactions, active, is_active, first = work[3], work[4], work[7], work[8], work[9]
    k = _feasible_start(work)
    tolerance = _write_gaps(work, k)
    for _ in range(STEPS_PER_ROW * len(gaps) + 100):
        lowest, new = -tolerance, -1
        for row in range(len(gaps)):
            if not is_active[row]:
                gap = -abs(gaps[row]) if row >= first else gaps[row]
                if gap < lowest:
                    lowest, new = gap, row
        if new < 0:
            return SOLVED
        if new >= first:
            _write_ray(work, k, new)
            return INFEASIBLE  # an equation that depends on others, and contradicts them
        left = _activate(work, k, new)
        if left <= 0:
            _write_ray(work, -left, new)
            return INFEASIBLE
        k = left
        is_active[new] = True
        _solve_active(work, k)
        tolerance = _refine(work, k)
        for j in range(k):  # of rounding
            if active[j] < first and reactions[active[j]] < 0:
                reactions[active[j]] = 0.0
    return UNFINISHED


@inner
def _activate(work, k, new):  # type: ignore[no-untyped-def]
    """Raise the reaction of a `new` row until its gap is 0; return the number of active rows, negated if that is impossible.

    Along the way, the gaps of active rows stay 0: their reactions change by -W_aa^-1 W_an for each unit of the new one.
    """
    reactions, factor, y, active, first = work[4], work[5], work[6], work[7], work[9]
    gap = work[3][new]
    while True:
        is_independent = append_row(work, k, new)
        for j in range(k):
            y[j] = factor[j, k]
        back_substitute(factor, k, y)
        rate = factor[k, k] ** 2
        step, blocking = (-gap / rate if is_independent else np.inf), -1
        for j in range(k):
            if active[j] < first and y[j] > 0 and reactions[active[j]] < step * y[j]:
                step, blocking = reactions[active[j]] / y[j], j
        if blocking < 0 and not is_independent:
            return -k
        for j in range(k):
            reactions[active[j]] -= step * y[j]
        reactions[new] += step
        if is_independent:
            gap += step * rate
        if blocking < 0:
            active[k] = new
            return k + 1
        reactions[active[blocking]] = 0.0
        remove_row(work, k, blocking)
        k -= 1


@inner
def _write_ray(work, k, new):  # type: ignore[no-untyped-def]
    """Write reactions that change no gap: 1 of a `new` row that depends on k active ones, and what balances it."""
    gaps, reactions, factor, y, active, first = work[3], work[4], work[5], work[6], work[7], work[9]
    append_row(work, k, new)
    for j in range(k):
        y[j] = factor[j, k]
    back_substitute(factor, k, y)
    sign = -1.0 if new >= first and gaps[new] > 0 else 1.0
    for i in range(len(reactions)):
        reactions[i] = 0.0
    reactions[new] = sign
    for j in range(k):
        reactions[active[j]] = -sign * y[j] if active[j] >= first else max(-sign * y[j], 0.0)
