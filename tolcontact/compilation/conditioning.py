"""The conditioned QP and its outcome: poses, reactions and residuals.

Its objective has unit diagonal blocks, its rows have length 1, and slacks make it feasible.
"""

import itertools
from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from tolcontact.compilation.qp_terms import Call, Rows
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.group_equations import GroupEquations
from tolcontact.mechanics.placement import misfit
from tolcontact.mechanics.pose import Number, Pose

QP_ENTRIES = ("h", "g", "a", "lba", "to_z", "length")  # of the solved QP, for its residuals
SOLUTION = ("x", "lam_a", "lam_x")
SLACK = 1e-3  # mm of gap for a slack of 1 mm, unless its row is compliant
IDLE_DISTANCE = 1e3  # lengths of the group: bound of an empty row, which is never active


def conditioned(
    system: GroupEquations, Q: ca.SX, gradient: ca.SX, rows: Rows, locator_misfit: ca.SX, scale: ca.SX, call: Call
) -> dict[str, ca.SX]:
    """Return the QP min 1/2 y'Hy + g'y with lba <= a y <= uba, in y = (U z, slacks), and the `length` of the unscaled rows.

    The `locator_misfit` (locator, 1) [mm] of exact two-sided locators gives the last rows, which are equations. A compliant row
    has its own slack without a price, after the slacks of the pairs. With the opening sqrt(C), this slack adds C times the
    multiplier to the gap. Slacks of elastic parts are left out, see ContactQP. `scale` is the scale of the objective.
    """
    pairs, springs, equations = len(system.group.pairs), rows.springs, locator_misfit.numel()
    H, to_z = unit_blocks(Q, call)
    opening = ca.SX.ones(len(rows)) * SLACK
    for k in springs:
        opening[k] = ca.sqrt(rows.compliance[k] * scale)
    A, scaled_opening, lower, length = conditioned_rows(rows, to_z, opening, system.group.length, call)
    upper = ca.SX(ca.DM(np.full(len(rows), np.inf)))
    # Slacks of springs follow those of the pairs. The slack of a pair without rigid rows is in no row, and has no price.
    owners, is_rigid = rows.pairs.copy(), np.ones(len(rows), dtype=bool)
    owners[springs], is_rigid[springs] = pairs + np.arange(len(springs)), False
    priced = np.isin(np.arange(pairs + len(springs)), owners[is_rigid])
    if rows.flexibility is not None:
        priced = priced[:pairs]
        upper = ca.vertcat(*(lower[k] if holds else np.inf for k, holds in enumerate(rows.flexibility.holds)))
    opens = ca.sparsify(ca.DM(np.equal.outer(owners, range(len(priced))).astype(float)))
    B, targets = system.slope(locator_misfit) @ to_z, -system.at_rest(locator_misfit)
    return {
        "h": ca.diagcat(H, ca.SX.eye(len(priced))),
        "g": ca.vertcat(to_z.T @ gradient, ca.DM(priced.astype(float)) * system.group.length),
        "a": ca.blockcat([[A, ca.diag(scaled_opening) @ opens], [B, ca.SX(equations, len(priced))]]),
        "lba": ca.vertcat(lower, targets),
        "uba": ca.vertcat(upper, targets),
        "to_z": to_z,
        "length": length,
    }


def conditioned_rows(rows: Rows, to_z: ca.SX, opening: ca.SX, group_length: Number, call: Call) -> list[ca.SX]:
    """Return A, scaled openings o, lower and length (row, 1) of rows A y + o s >= lower of length 1 in y, with z = to_z y.

    Multipliers are then in the norm of the objective, however weakly it constrains a degree of freedom. A slack of 1 mm adds
    `opening` (row, 1) [mm] to a gap. `length` is the length of the unscaled rows. The rows of empty slots are idle.
    """

    def of_length_1(slopes: ca.SX, to_z: ca.SX, gaps: ca.SX, opening: ca.SX, *slots: ca.SX) -> Sequence[ca.SX]:
        A = slopes @ to_z
        length = ca.sqrt(ca.sum2(A**2))
        length = ca.if_else(length > 0, length, 1)
        A, lower = ca.diag(1 / length) @ A, -gaps / length
        if slots:
            filled, idle = slots
            chosen = [(A[k, :], ca.if_else(filled[k], A[k, :].T.nz[:], idle[k, :].T.nz[:])) for k in range(A.size1())]
            A = ca.vertcat(*(ca.SX(row.sparsity(), entries) for row, entries in chosen))
            lower = ca.if_else(filled, lower, -IDLE_DISTANCE * group_length)
        return A, opening / length, lower, length

    results = [(ca.SX(0, to_z.size1()), *[ca.SX(0, 1)] * 3)]
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
        results.append((wide, *vectors))
    return [ca.vertcat(*column) for column in zip(*results, strict=True)]


def unit_blocks(Q: ca.SX, call: Call) -> tuple[ca.SX, ca.SX]:
    """Return H = V'QV with unit diagonal blocks, and V = U^-1 (z = V y), block diagonal and upper triangular."""
    movers = [slice(k, k + FREEDOMS) for k in range(0, Q.size1(), FREEDOMS)]
    V = [call("whitening", lambda Q: [ca.solve(ca.chol(ca.densify(Q)), ca.SX.eye(FREEDOMS))], Q[k, k])[0] for k in movers]

    def block(i: int, j: int) -> ca.SX:
        if i == j:
            return ca.SX.eye(FREEDOMS)
        Q_ij = Q[movers[i], movers[j]]
        if not Q_ij.nnz():
            return ca.SX(FREEDOMS, FREEDOMS)
        return call("coupling", lambda Q, V_i, V_j: [V_i.T @ Q @ V_j], Q_ij, V[i], V[j])[0]

    indices = range(len(movers))
    return ca.sparsify(ca.blockcat([[block(i, j) for j in indices] for i in indices])), ca.diagcat(*V)


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


def outcome(
    system: GroupEquations,
    scale: ca.SX,
    rows: Rows,
    poses: Sequence[Pose],
    problem: Mapping[str, ca.SX],
    stride: ca.SX,
    call: Call,
) -> tuple[dict[str, ca.SX], dict[str, ca.SX]]:
    """Return symbols of the QP and its solution, and the outputs of contact_qp as expressions of them.

    `poses` are the poses after z. The QP's matrices are inputs, so that nothing is computed twice and the residuals belong to
    the QP that was solved.
    """
    group, z, count = system.group, system.z, len(rows)
    slacks = len(group.pairs) + (len(rows.springs) if rows.flexibility is None else 0)
    size, equations = z.numel() + slacks, problem["a"].size1() - count
    symbols = {name: ca.SX.sym(name, problem[name].sparsity()) for name in QP_ENTRIES}
    symbols |= {"x": ca.SX.sym("x", size), "lam_a": ca.SX.sym("lam_a", count + equations), "lam_x": ca.SX.sym("lam_x", size)}
    x, lam_a, lam_x, length = symbols["x"], symbols["lam_a"], symbols["lam_x"], symbols["length"]
    y, s, lam_s = x[: z.numel()], x[z.numel() :], lam_x[z.numel() :]
    ends = np.flatnonzero(np.diff(rows.pairs, prepend=-1, append=-1)).tolist()  # of the rows of each pair; equations follow
    spans = [slice(a, b) for a, b in itertools.pairwise([*ends, count + equations])]
    excess = ca.vertcat(*_products(symbols["a"], x, spans, call)) - symbols["lba"]
    if rows.bent is not None:
        excess += ca.vertcat(rows.bent / length, ca.SX(equations, 1))
    natural, gaps = ca.fmin(excess[:count], -lam_a[:count]), excess[:count] * length
    if rows.flexibility is not None:  # rows of two-sided locators are equations
        natural = ca.if_else(ca.DM(rows.flexibility.holds.astype(float)), gaps, natural)
    natural = ca.vertcat(natural, ca.fmin(gaps, 0), ca.fmin(s, -lam_s))
    movers = [slice(k, k + FREEDOMS) for k in range(0, z.numel(), FREEDOMS)] + [slice(z.numel(), size)]
    pull, push = (_products(matrix, values, movers, call) for matrix, values in ((symbols["h"], x), (symbols["a"].T, lam_a)))
    stationarity = ca.norm_inf(ca.vertcat(*pull) + symbols["g"] + ca.vertcat(*push) + lam_x)
    residuals = [stationarity, ca.norm_inf(natural), *([ca.norm_inf(excess[count:])] if equations else [])]
    step = symbols["to_z"] @ y
    taken_step = step
    if system.method.is_exact:  # no mover rotates by more than `stride` [rad] about any axis
        rotations = ca.vertcat(*(step[k + 3 : k + FREEDOMS] for k in range(0, z.numel(), FREEDOMS)))
        taken_step = step * ca.fmin(1, stride * group.length / ca.norm_inf(rotations))
    end_values = {
        "corrected": ca.vertcat(*(pose.vector() for pose in poses)),
        "relative": ca.vertcat(*(X_RM.vector() for X_RM in system.relative(poses))),
        "locator_residual": ca.norm_inf(misfit(system, poses)) if equations else ca.SX(0),
    }
    results = {
        "linearized": ca.substitute(rows.relative, z, step),
        "multipliers": -lam_a[:count] / length * rows.filled * scale,
        "residual": ca.mmax(ca.vertcat(*residuals)),
        "slack": SLACK * s[: len(group.pairs)],
        "step": ca.vertcat(ca.norm_inf(step), ca.norm_inf(y)),
        **{name: ca.substitute(value, z, taken_step) for name, value in end_values.items()},
    }
    return symbols, {name: ca.densify(value) for name, value in results.items()}


def _products(matrix: ca.SX, vector: ca.SX, spans: Sequence[slice], call: Call) -> list[ca.SX]:
    """Return the product of some rows of a sparse matrix with a vector, for each span of rows."""
    products: list[ca.SX] = []
    for span in spans:
        columns = sorted(set(matrix[span, :].sparsity().get_triplet()[1]))
        products += call("product", lambda block, values: [block @ values], matrix[span, columns], vector[columns])
    return products
