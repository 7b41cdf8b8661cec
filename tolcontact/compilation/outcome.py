"""The outcome of a QP: poses, reactions, and their residuals."""

import itertools
from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Int
from tolcontact.compilation.calls import Call
from tolcontact.compilation.conditioning import SLACK
from tolcontact.compilation.contact_rows import Rows
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.group_equations import GroupEquations
from tolcontact.mechanics.placement import misfit
from tolcontact.mechanics.pose import Number, Pose

QP_ENTRIES = ("h", "g", "a", "lba", "to_z", "length")  # of the solved QP, for its residuals
SOLUTION = ("x", "lam_a", "lam_x")


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
    excess = ca.vertcat(*_products(symbols["a"], x, _spans(rows.pairs, equations), call)) - symbols["lba"]
    if rows.bent is not None:
        excess += ca.vertcat(rows.bent / length, ca.SX(equations, 1))
    natural = ca.vertcat(row_residuals(rows, excess[:count], lam_a[:count], length), ca.fmin(s, -lam_s))
    movers = [slice(k, k + FREEDOMS) for k in range(0, z.numel(), FREEDOMS)] + [slice(z.numel(), size)]
    pull, push = (_products(matrix, values, movers, call) for matrix, values in ((symbols["h"], x), (symbols["a"].T, lam_a)))
    stationarity = ca.norm_inf(ca.vertcat(*pull) + symbols["g"] + ca.vertcat(*push) + lam_x)
    residuals = [stationarity, ca.norm_inf(natural), *([ca.norm_inf(excess[count:])] if equations else [])]
    step = symbols["to_z"] @ y
    taken_step = step
    if system.method.is_exact:
        taken_step = step * step_share(step, stride, group.length)
    end_values = {
        "corrected": ca.vertcat(*(pose.vector() for pose in poses)),
        "relative": ca.vertcat(*(X_RM.vector() for X_RM in system.relative(poses))),
        "locator_residual": ca.norm_inf(misfit(system, poses)) if equations else ca.SX(0),
    }
    results = {
        "linearized": ca.substitute(rows.relative, z, step),
        "multipliers": reactions(lam_a[:count], length, rows.filled, scale),
        "residual": ca.mmax(ca.vertcat(*residuals)),
        "slack": SLACK * s[: len(group.pairs)],
        "step": ca.vertcat(ca.norm_inf(step), ca.norm_inf(y)),
        **{name: ca.substitute(value, z, taken_step) for name, value in end_values.items()},
    }
    return symbols, {name: ca.densify(value) for name, value in results.items()}


def _spans(pairs: Int[Array, " row"], equations: int) -> list[slice]:
    """Return the rows of each pair, and the equations, which follow them."""
    ends = np.flatnonzero(np.diff(pairs, prepend=-1, append=-1)).tolist()
    return [slice(a, b) for a, b in itertools.pairwise([*ends, len(pairs) + equations])]


def _products(matrix: ca.SX, vector: ca.SX, spans: Sequence[slice], call: Call) -> list[ca.SX]:
    """Return the product of some rows of a sparse matrix with a vector, for each span of rows."""
    products: list[ca.SX] = []
    for span in spans:
        columns = sorted(set(matrix[span, :].sparsity().get_triplet()[1]))
        products += call("product", lambda block, values: [block @ values], matrix[span, columns], vector[columns])
    return products


def row_residuals(rows: Rows, excess: ca.SX, lam: ca.SX, length: ca.SX) -> ca.SX:
    """Return the residuals of rows (row, 1): of min(row, multiplier) = 0, and the depth of gaps that remain negative.

    The rows of two-sided locators are equations: of these, it is the distance [mm] from the locator.
    """
    natural, depth = ca.fmin(excess, -lam), ca.fmin(excess * length, 0)
    if rows.flexibility is not None:
        natural = ca.if_else(ca.DM(rows.flexibility.holds.astype(float)), excess * length, natural)
    return ca.vertcat(natural, depth)


def reactions(lam: ca.SX, length: ca.SX, filled: ca.SX, scale: ca.SX) -> ca.SX:
    """Return the reactions of rows (row, 1) in the units of the objective."""
    return -lam / length * filled * scale


def step_share(step: ca.SX, stride: ca.SX, length: Number) -> ca.SX:
    """Return the share of a step (z, 1) [mm] that rotates no mover by more than `stride` [rad] about any axis."""
    rotations = ca.vertcat(*(step[k + 3 : k + FREEDOMS] for k in range(0, step.numel(), FREEDOMS)))
    return ca.fmin(1, stride * length / ca.norm_inf(rotations))
