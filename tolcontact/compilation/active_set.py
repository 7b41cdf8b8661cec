"""The active set of a QP: the rows that carry and the slacks that are open, for which its answer is one linear system."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation.polish_kernel import solve_conditions

COMPLIANCE = 1e-9  # of the rows, so that dependent rows have a solution; refinement removes its effect
REFINEMENTS = 4

Problem = Mapping[str, Float[Array, "QP ..."]]


class ActiveSet(NamedTuple):
    """The active sets of QPs: min x'Hx/2 + g'x, a x >= lba; the last rows are equations, the last variables, slacks, >= 0.

    carries   (QP, row)
    is_open   (QP, slack)
    """

    carries: Bool[Array, "QP row"]
    is_open: Bool[Array, "QP slack"]

    @classmethod
    def of_answer(cls, problem: Problem, answer: Mapping[str, np.ndarray], equations: int, slacks: int) -> "ActiveSet":
        """Return the active sets of a solver's answers.

        problem     h (QP, n, n), g (QP, n), a (QP, row, n), lba (QP, row)
        answer      x (QP, n), lam_a (QP, row), lam_x (QP, n) of a solver; multipliers are below 0 if a row carries
        """
        A, lower = problem["a"], problem["lba"]
        x, lam_a, lam_x = (answer[name] for name in ("x", "lam_a", "lam_x"))
        # Of a row and its multiplier the smaller one is rounding, for every solver.
        carries = -lam_a > np.einsum("kij,kj->ki", A, x) - lower
        carries[:, carries.shape[1] - equations :] = True
        return cls(carries, (-lam_x <= x)[:, x.shape[1] - slacks :])

    def answer(self, problem: Problem, order: Int[Array, " unknown"]) -> dict[str, np.ndarray]:
        """Return x, lam_a and lam_x (QP, entry) of the QPs; NaN if the conditions have no solution.

        order   of the unknowns, see solve_conditions
        """
        H, g, A, lower = (problem[name] for name in ("h", "g", "a", "lba"))
        count, rows, size = A.shape
        slacks = self.is_open.shape[1]
        solution = np.empty((count, size + rows + slacks))
        solve_conditions((H, g, A, lower), self.carries, self.is_open, order, COMPLIANCE, REFINEMENTS, solution)
        x, multipliers = solution[:, :size], solution[:, size:]
        lam_x = np.zeros_like(x)
        lam_x[:, size - slacks :] = -multipliers[:, rows:]
        return {"x": x, "lam_a": -multipliers[:, :rows], "lam_x": lam_x}
