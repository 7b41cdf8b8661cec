"""Conditioning of the QP: its objective has unit diagonal blocks, its rows have length 1, and slacks make it solvable."""

import casadi as ca
import numpy as np

from tolcontact.compilation.contact_rows import Rows
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.setting import Setting

SLACK = 1e-3  # mm of gap that a slack of 1 mm opens
IDLE_DISTANCE = 1e3  # lengths of the group: bound of an empty row, which never binds


def conditioned(setting: Setting, Q: ca.SX, pull: ca.SX, rows: Rows, misfit: ca.SX) -> dict[str, ca.SX]:
    """Return the QP min 1/2 y'Hy + g'y with lba <= a y <= uba, in y = (U z, slacks), and the `length` of the unscaled rows.

    `misfit` (locator, 1) [mm] of exact two-sided locators gives the last rows, which are equations.
    """
    pairs, equations = len(setting.group.pairs), misfit.numel()
    H, U = _unit_blocks(Q)
    to_z = whitening(U)
    A = rows.slopes @ to_z
    # Rows of length 1 in y: multipliers are then in the norm of the objective, however weakly that holds a freedom.
    length = ca.sqrt(ca.sum2(A**2))
    length = ca.if_else(length > 0, length, 1)
    A = ca.diag(1 / length) @ A
    fill = rows.filled
    A = ca.vertcat(*(A[k, :] if fill[k].is_one() else _row_or_idle(fill[k], A[k, :], k) for k in range(len(rows))))
    B = setting.slope(misfit) @ to_z
    opens = ca.sparsify(ca.DM(np.equal.outer(rows.pairs, range(pairs)).astype(float)))
    targets = -setting.at_rest(misfit)
    return {
        "h": ca.diagcat(H, ca.SX.eye(pairs)),
        "g": ca.vertcat(to_z.T @ pull, ca.DM(np.full(pairs, setting.group.length))),
        "a": ca.blockcat([[A, ca.diag(SLACK / length) @ opens], [B, ca.SX(equations, pairs)]]),
        "lba": ca.vertcat(ca.if_else(fill, -rows.gaps / length, -IDLE_DISTANCE * setting.group.length), targets),
        "uba": ca.vertcat(ca.DM(np.full(len(rows), np.inf)), targets),
        "u": U,
        "length": length,
    }


def whitening(U: ca.SX) -> ca.SX:
    """Return U^-1, block by block: z = U^-1 y."""
    movers = range(0, U.size1(), FREEDOMS)
    return ca.diagcat(*(ca.solve(U[k : k + FREEDOMS, k : k + FREEDOMS], ca.SX.eye(FREEDOMS)) for k in movers))


def _unit_blocks(Q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return H = U^-T Q U^-1 with unit diagonal blocks, and U, block diagonal and upper triangular."""
    movers = range(0, Q.size1(), FREEDOMS)
    factors = [ca.chol(ca.densify(Q[k : k + FREEDOMS, k : k + FREEDOMS])) for k in movers]
    blocks = [
        [
            ca.SX.eye(FREEDOMS) if i == j else ca.solve(U_i.T, ca.solve(U_j.T, Q[i : i + FREEDOMS, j : j + FREEDOMS].T).T)
            for j, U_j in zip(movers, factors, strict=True)
        ]
        for i, U_i in zip(movers, factors, strict=True)
    ]
    return ca.sparsify(ca.blockcat(blocks)), ca.diagcat(*factors)


def _row_or_idle(filled: ca.SX, row: ca.SX, seed: int) -> ca.SX:
    """Return a row; if its slot is empty, return a row in general position, which does not bind because its bound is far away.

    Other plugins accept rows of zeros. qpOASES starts from the rows that carried in the previous problem, and fails if one of
    them has become zero.
    """
    idle = np.random.default_rng(seed).normal(size=row.nnz())
    return ca.SX(row.sparsity(), ca.if_else(filled, row.T.nz[:], ca.DM(idle / np.linalg.norm(idle))))
