"""Polishing of a solver's answer to a QP, down to rounding.

Solvers stop at their own tolerance, which limits the true residual only loosely. But they know much earlier which rows carry.
With these rows as equations the optimality conditions are one linear system.
"""

from collections.abc import Mapping

import numpy as np

COMPLIANCE = 1e-9  # of the rows, so that dependent rows have a solution; refinement removes its effect
REFINEMENTS = 4


def polished(
    problem: Mapping[str, np.ndarray], answer: Mapping[str, np.ndarray], equations: int, slacks: int
) -> dict[str, np.ndarray]:
    """Return x, lam_a and lam_x (QP, entry) of min x'Hx/2 + g'x, a x >= lba; the last rows are equations, the last x >= 0.

    problem     h (QP, n, n), g (QP, n), a (QP, m, n), lba (QP, m)
    answer      x (QP, n), lam_a (QP, m), lam_x (QP, n) of a solver; multipliers are below 0 if a row carries

    They are NaN if the conditions have no solution.
    """
    H, g, A, lower = (problem[name] for name in ("h", "g", "a", "lba"))
    x, lam_a, lam_x = (answer[name] for name in ("x", "lam_a", "lam_x"))
    count, rows, size = A.shape
    # Of a row and its multiplier the smaller one is rounding, for every solver.
    carries = -lam_a > np.einsum("kij,kj->ki", A, x) - lower
    carries[:, rows - equations :] = True
    at_zero = (-lam_x > x)[:, size - slacks :]
    slack_rows = np.zeros((count, slacks, size))
    slack_rows[:, :, size - slacks :] = np.eye(slacks)
    all_rows = np.concatenate([A, slack_rows], axis=1)
    is_equation = np.concatenate([carries, at_zero], axis=1)
    all_bounds = np.concatenate([lower, np.zeros((count, slacks))], axis=1)
    C = np.where(is_equation[..., None], all_rows, 0.0)
    idle = np.eye(rows + slacks) * ~is_equation[:, None, :]
    K = np.concatenate(
        [np.concatenate([H, -C.swapaxes(1, 2)], axis=2), np.concatenate([C, idle], axis=2)],
        axis=1,
    )
    right_side = np.concatenate([-g, np.where(is_equation, all_bounds, 0.0)], axis=1)
    regularized = K.copy()
    regularized[:, size:, size:] += COMPLIANCE * np.eye(rows + slacks) * is_equation[:, None, :]
    solution = np.zeros_like(right_side)
    inverse = _inverse(regularized)
    for _ in range(REFINEMENTS):
        remainder = right_side - np.einsum("kij,kj->ki", K, solution)
        solution += np.einsum("kij,kj->ki", inverse, remainder)
    x, multipliers = solution[:, :size], solution[:, size:]
    lam_x = np.zeros_like(x)
    lam_x[:, size - slacks :] = -multipliers[:, rows:]
    return {"x": x, "lam_a": -multipliers[:, :rows], "lam_x": lam_x}


def _inverse(matrices: np.ndarray) -> np.ndarray:
    """Return the inverses (QP, n, n), NaN for a singular matrix, which must not spoil the others."""
    try:
        return np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full_like(matrices, np.nan)
        return np.concatenate([_inverse(matrix[None]) for matrix in matrices])
