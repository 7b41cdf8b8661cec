"""The active set of a QP: the rows that carry and the slacks that are open, for which its answer is one linear system."""

from collections.abc import Mapping
from typing import NamedTuple

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation.polish_kernel import solve_conditions
from tolcontact.mechanics.correction import FREEDOMS

COMPLIANCE = 1e-9  # of the rows, so that dependent rows have a solution; refinement removes its effect
REFINEMENTS = 4

Problem = Mapping[str, Float[Array, "QP ..."]]


class ActiveSet(NamedTuple):
    """The active sets of QPs: min x'Hx/2 + g'x, a x >= lba; the last rows are equations, the last variables, slacks, >= 0.

    active   (QP, row)
    is_open   (QP, slack)
    """

    active: Bool[Array, "QP row"]
    is_open: Bool[Array, "QP slack"]

    @classmethod
    def of_answer(cls, problem: Problem, answer: Mapping[str, np.ndarray], equations: int, slacks: int) -> "ActiveSet":
        """Return the active sets of a solver's answers.

        problem     h (QP, n, n), g (QP, n), a (QP, row, n), lba (QP, row)
        answer      x (QP, n), lam_a (QP, row), lam_x (QP, n) of a solver; multipliers are below 0 if a row active
        """
        A, lower = problem["a"], problem["lba"]
        x, lam_a, lam_x = (answer[name] for name in ("x", "lam_a", "lam_x"))
        # Of a row and its multiplier the smaller one is rounding, for every solver.
        active = -lam_a > np.einsum("kij,kj->ki", A, x) - lower
        active[:, active.shape[1] - equations :] = True
        return cls(active, (-lam_x <= x)[:, x.shape[1] - slacks :])

    def answer(self, problem: Problem, order: Int[Array, " unknown"]) -> dict[str, np.ndarray]:
        """Return x, lam_a and lam_x (QP, entry) of the QPs; NaN if the conditions have no solution.

        order   of the unknowns, see solve_conditions
        """
        H, g, A, lower = (problem[name] for name in ("h", "g", "a", "lba"))
        count, rows, size = A.shape
        slacks = self.is_open.shape[1]
        solution = np.empty((count, size + rows + slacks))
        solve_conditions((H, g, A, lower), self.active, self.is_open, order, COMPLIANCE, REFINEMENTS, solution)
        x, multipliers = solution[:, :size], solution[:, size:]
        lam_x = np.zeros_like(x)
        lam_x[:, size - slacks :] = -multipliers[:, rows:]
        return {"x": x, "lam_a": -multipliers[:, :rows], "lam_x": lam_x}


def band_order(h: ca.Sparsity, a: ca.Sparsity, *, slacks: int) -> Int[Array, " unknown"]:
    """Return the variables of the movers, and the rows after them, mover by mover; a row follows the last of its movers.

    Movers are in the order of Cuthill and McKee.
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
    """Return the nodes of a graph, each island level by level, from the last node of its levels about any of its nodes."""
    order: list[int] = []
    for node in range(len(neighbours)):
        if node not in order:
            order += _levels(neighbours, _levels(neighbours, node)[-1])
    return order


def _levels(neighbours: list[set[int]], start: int) -> list[int]:
    """Return the nodes that are connected with `start`, the nearest ones first, of these those with few neighbours."""
    order, reached = [start], {start}
    for node in order:
        following = sorted(neighbours[node] - reached, key=lambda other: (len(neighbours[other]), other))
        order += following
        reached.update(following)
    return order
