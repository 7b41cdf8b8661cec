"""Conditioning of the QP: unit diagonal blocks in its objective, rows of length 1, and slacks that make it feasible."""

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Bool, Int
from tolcontact.compilation.calls import Call
from tolcontact.compilation.contact_rows import Rows, springs_of
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.group_equations import GroupEquations
from tolcontact.mechanics.pose import Number

SLACK = 1e-3  # mm of gap for a slack of 1 mm, unless its row is compliant
IDLE_DISTANCE = 1e3  # lengths of the group: bound of an empty row, which is never active


class ConditionedRows(NamedTuple):
    """Rows A y + opening s >= lower of length 1 in y; `length` (row, 1) is the length of the unscaled rows."""

    A: ca.SX
    opening: ca.SX
    lower: ca.SX
    length: ca.SX


def conditioned(
    system: GroupEquations, Q: ca.SX, gradient: ca.SX, rows: Rows, misfit: ca.SX, scale: ca.SX, call: Call
) -> dict[str, ca.SX]:
    """Return the QP min 1/2 y'Hy + g'y with lba <= a y <= uba, in y = (U z, slacks), and the `length` of the unscaled rows.

    The `misfit` (locator, 1) [mm] of exact two-sided locators gives the last rows, which are equations. A compliant row has its
    own slack without a price, after the slacks of the pairs. With the opening sqrt(C), this slack adds C times the multiplier
    to the gap. Slacks of elastic parts are left out, see ElasticColumns. `scale` is the scale of the objective.
    """
    pairs, equations = len(system.group.pairs), misfit.numel()
    H, to_z = unit_blocks(Q, call)
    gap_rows = conditioned_rows(rows, to_z, openings(rows.compliance, scale), system.group.length, call)
    B = system.slope(misfit) @ to_z
    owners, priced = slack_owners(rows.pairs, rows.springs, pairs)
    if rows.flexibility is not None:
        priced = priced[:pairs]
    opens = ca.sparsify(ca.DM(np.equal.outer(owners, range(len(priced))).astype(float)))
    targets = -system.at_rest(misfit)
    return {
        "h": ca.diagcat(H, ca.SX.eye(len(priced))),
        "g": ca.vertcat(to_z.T @ gradient, ca.DM(priced.astype(float)) * system.group.length),
        "a": ca.blockcat([[gap_rows.A, ca.diag(gap_rows.opening) @ opens], [B, ca.SX(equations, len(priced))]]),
        "lba": ca.vertcat(gap_rows.lower, targets),
        "uba": ca.vertcat(_upper(rows, gap_rows.lower), targets),
        "to_z": to_z,
        "length": gap_rows.length,
    }


def _upper(rows: Rows, lower: ca.SX) -> ca.SX:
    """Return the upper bounds of the rows: infinite, but of two-sided locators the lower ones."""
    if rows.flexibility is None:
        return ca.SX(ca.DM(np.full(len(rows), np.inf)))
    return ca.vertcat(*(lower[k] if holds else np.inf for k, holds in enumerate(rows.flexibility.holds)))


def slack_owners(
    pairs: Int[Array, " row"], springs: Sequence[int], pair_count: int
) -> tuple[Int[Array, " row"], Bool[Array, " slack"]]:
    """Return the slack of each row, and which slacks have a price, from the `pairs` of the rows and the `springs` among them.

    Slacks of springs follow the slacks of the pairs. The slack of a pair without rigid rows is in no row, and has no price.
    """
    owners, is_rigid = pairs.copy(), np.ones(len(pairs), dtype=bool)
    owners[springs] = pair_count + np.arange(len(springs))
    is_rigid[springs] = False
    return owners, np.isin(np.arange(pair_count + len(springs)), owners[is_rigid])


def openings(compliance: ca.SX, scale: ca.SX) -> ca.SX:
    """Return the opening (row, 1) of the rows: gap [mm] for a slack of 1 mm, from their compliance (row, 1) [mm/N]."""
    opening = ca.SX.ones(compliance.numel()) * SLACK
    for k in springs_of(compliance):
        opening[k] = ca.sqrt(compliance[k] * scale)
    return opening


def conditioned_rows(rows: Rows, to_z: ca.SX, opening: ca.SX, group_length: Number, call: Call) -> ConditionedRows:
    """Return rows of length 1 in y, with z = to_z y. The rows of empty slots are idle.

    Multipliers are then in the norm of the objective, however weakly it constrains a degree of freedom. A slack of 1 mm adds
    `opening` (row, 1) [mm] to a gap.
    """

    def of_length_1(slopes: ca.SX, to_z: ca.SX, gaps: ca.SX, opening: ca.SX, *slots: ca.SX) -> ConditionedRows:
        A = slopes @ to_z
        length = ca.sqrt(ca.sum2(A**2))
        length = ca.if_else(length > 0, length, 1)
        A, lower = ca.diag(1 / length) @ A, -gaps / length
        if slots:
            filled, idle = slots
            A = ca.vertcat(*(_row_or_idle(filled[k], A[k, :], idle[k, :]) for k in range(A.size1())))
            lower = ca.if_else(filled, lower, -IDLE_DISTANCE * group_length)
        return ConditionedRows(A, opening / length, lower, length)

    results = [ConditionedRows(ca.SX(0, to_z.size1()), *[ca.SX(0, 1)] * 3)]
    for pair in dict.fromkeys(rows.pairs.tolist()):
        first, last = np.flatnonzero(rows.pairs == pair)[[0, -1]].tolist()
        span = slice(first, last + 1)
        movers = sorted({column // FREEDOMS for column in rows.slopes[span, :].sparsity().get_triplet()[1]})
        z = [FREEDOMS * mover + k for mover in movers for k in range(FREEDOMS)]
        slopes, V, filled = rows.slopes[span, z], to_z[z, z], rows.filled[span]
        pattern = ca.mtimes(slopes.sparsity(), V.sparsity())
        slots = [] if ca.SX(filled).is_one() else [filled, _idle_rows(pattern, first)]
        A, *vectors = call("rows", of_length_1, slopes, V, rows.gaps[span], opening[span], *slots)
        wide = ca.SX(A.size1(), to_z.size1())
        wide[:, z] = A
        results.append(ConditionedRows(wide, *vectors))
    return ConditionedRows(*(ca.vertcat(*column) for column in zip(*results, strict=True)))


def unit_blocks(Q: ca.SX, call: Call) -> tuple[ca.SX, ca.SX]:
    """Return H = V'QV with unit diagonal blocks, and V = U^-1 (z = V y), block diagonal and upper triangular."""
    movers = [slice(k, k + FREEDOMS) for k in range(0, Q.size1(), FREEDOMS)]
    V = [call("whitening", _whitening, Q[k, k])[0] for k in movers]

    def block(i: int, j: int) -> ca.SX:
        Q_ij = Q[movers[i], movers[j]]
        if i == j:
            return ca.SX.eye(FREEDOMS)
        return call("coupling", _coupling, Q_ij, V[i], V[j])[0] if Q_ij.nnz() else ca.SX(FREEDOMS, FREEDOMS)

    indices = range(len(movers))
    return ca.sparsify(ca.blockcat([[block(i, j) for j in indices] for i in indices])), ca.diagcat(*V)


def _whitening(Q: ca.SX) -> list[ca.SX]:
    """Return V = U^-1 (6, 6) of a mover's block Q = U'U."""
    return [ca.solve(ca.chol(ca.densify(Q)), ca.SX.eye(FREEDOMS))]


def _coupling(Q: ca.SX, V_i: ca.SX, V_j: ca.SX) -> list[ca.SX]:
    """Return the block (6, 6) of H that couples two movers, from their block of Q."""
    return [V_i.T @ Q @ V_j]


def _idle_rows(pattern: ca.Sparsity, first: int) -> ca.SX:
    """Return rows of length 1 in general position, for rows with a sparsity pattern from a `first` row of the QP.

    Their bounds are far away, so they are never active. Most plugins accept rows of zeros. qpOASES starts from the active set
    of the previous problem, and fails if one of its rows has become zero.
    """
    rows, entries = np.array(pattern.row()), np.zeros(pattern.nnz())
    for k in range(pattern.size1()):
        row = np.random.default_rng(first + k).normal(size=int((rows == k).sum()))
        entries[rows == k] = row / np.linalg.norm(row)
    return ca.SX(ca.DM(pattern, entries))


def _row_or_idle(filled: ca.SX, row: ca.SX, idle: ca.SX) -> ca.SX:
    return ca.SX(row.sparsity(), ca.if_else(filled, row.T.nz[:], idle.T.nz[:]))
