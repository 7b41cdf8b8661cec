"""The active set of a QP: its active rows and its positive slacks, for which the answer is one linear system."""

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation.polish_kernel import solve_conditions
from tolcontact.compilation.solver import Arrays
from tolcontact.mechanics.correction import FREEDOMS

COMPLIANCE = 1e-9  # of the rows, so that dependent rows have a solution; iterative refinement removes its effect
REFINEMENTS = 4

Problem = dict[str, Float[Array, "QP ..."]]


def active_set(
    problem: Problem, answer: Arrays, equalities: Int[Array, " k"], slacks: int
) -> tuple[Bool[Array, "QP row"], Bool[Array, "QP slack"]]:
    """Return which rows are active and which slacks are positive in a solver's answers: min x'Hx/2 + g'x, a x >= lba.

    The rows `equalities` are equations, and the last variables are slacks, >= 0.

    problem     h (QP, n, n), g (QP, n), a (QP, row, n), lba (QP, row)
    answer      x (QP, n), lam_a (QP, row), lam_x (QP, n) of a solver; multipliers of active rows are negative
    """
    x, lam_a, lam_x = (answer[name] for name in ("x", "lam_a", "lam_x"))
    # For every solver, either the row or its multiplier is zero up to rounding: the smaller of the two.
    active = -lam_a > np.einsum("kij,kj->ki", problem["a"], x) - problem["lba"]
    active[:, equalities] = True
    return active, (-lam_x <= x)[:, x.shape[1] - slacks :]


def solve_active(
    problem: Problem, active: Bool[Array, "QP row"], is_open: Bool[Array, "QP slack"], order: Int[Array, " unknown"]
) -> dict[str, Float[Array, "QP _"]]:
    """Return x, lam_a and lam_x (QP, entry) of QPs with an active set, each one linear system; NaN without a solution.

    order   order of the unknowns, see solve_conditions
    """
    H, g, A, lower = (problem[name] for name in ("h", "g", "a", "lba"))
    count, rows, size = A.shape
    slacks = is_open.shape[1]
    solution = np.empty((count, size + rows + slacks))
    solve_conditions((H, g, A, lower), active, is_open, order, COMPLIANCE, REFINEMENTS, solution)
    x, multipliers = solution[:, :size], solution[:, size:]
    lam_x = np.zeros_like(x)
    lam_x[:, size - slacks :] = -multipliers[:, rows:]
    return {"x": x, "lam_a": -multipliers[:, :rows], "lam_x": lam_x}


def band_order(h: ca.Sparsity, a: ca.Sparsity, *, slacks: int) -> Int[Array, " unknown"]:
    """Return the variables of the movers and the rows, mover by mover; each row follows the last of its movers.

    Movers are in Cuthill-McKee order.
    """
    size = h.size1() - slacks
    movers_of_rows: list[set[int]] = [set() for _ in range(a.size1())]
    for row, column in zip(*a.get_triplet(), strict=True):
        if column < size:
            movers_of_rows[row].add(column // FREEDOMS)
    neighbours: list[set[int]] = [set() for _ in range(size // FREEDOMS)]
    coupled = ({row // FREEDOMS, column // FREEDOMS} for row, column in zip(*h.get_triplet(), strict=True) if row < size)
    for movers in (*movers_of_rows, *coupled):
        for mover in movers:
            neighbours[mover] |= movers - {mover}
    rank = {mover: k for k, mover in enumerate(_cuthill_mckee(neighbours))}
    variables = [(rank[k // FREEDOMS], 0, k) for k in range(size)]
    rows = [(max((rank[mover] for mover in movers), default=-1), 1, size + k) for k, movers in enumerate(movers_of_rows)]
    return np.array([unknown for *_, unknown in sorted(variables + rows)], dtype=np.int64)


def _cuthill_mckee(neighbours: list[set[int]]) -> list[int]:
    """Return the nodes of a graph in Cuthill-McKee order.

    Each connected component is ordered level by level, starting from a node of the last level about an arbitrary node.
    """
    order: list[int] = []
    for node in range(len(neighbours)):
        if node not in order:
            order += _levels(neighbours, _levels(neighbours, node)[-1])
    return order


def _levels(neighbours: list[set[int]], start: int) -> list[int]:
    """Return the nodes that are connected to `start`, by distance from it; nodes with fewer neighbours come first."""
    order, reached = [start], {start}
    for node in order:
        level = sorted(neighbours[node] - reached, key=lambda neighbour: (len(neighbours[neighbour]), neighbour))
        order += level
        reached.update(level)
    return order
