"""Solve a QP of nearly dependent rows with the graph solver, in Python, which refuses an index out of bounds.

Of the twelve rows of one body and one slack, rounding makes nine independent; there are positions for eight.
"""

from pathlib import Path

import casadi as ca
import numpy as np

from tolcontact.compilation.graph import GraphSolver

qp = {name: values[None] for name, values in np.load(Path(__file__).parents[2] / "cases" / "full_joint.npz").items()}
sparsities = {
    "h": ca.Sparsity.diag(7), "g": ca.Sparsity.dense(7, 1), "a": ca.Sparsity.dense(12, 7), "lba": ca.Sparsity.dense(12, 1)
}  # fmt: skip
answer, failed = GraphSolver(sparsities, slacks=1, equations=0)(qp, qp["reactions"], qp["slacks"])
A = qp["a"].reshape(7, 12).T
if not failed[0]:
    x, multipliers = answer["x"][0], answer["lam_a"][0]
    assert (A @ x >= qp["lba"][0] - 1e-9).all() and (multipliers <= 0).all()
    assert np.abs(x + qp["g"][0] + A.T @ multipliers + answer["lam_x"][0])[:6].max() < 1e-6 * np.abs(multipliers).max()
