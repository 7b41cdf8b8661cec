"""The contact QP of one group of parts, as one CasADi Function, paper (9) to (12).

min 1/2 y'Hy + L s + 1/2 s^2   subject to   g_i + A_i y + SLACK s >= 0,  s >= 0

The increments z = (dt, L w) of a mover, all in mm (L is a length of the group's size), are z = U^-1 y, where U'U is the
mover's own block of (11): H then has unit blocks on its diagonal, and the few freedoms that only the regularization holds
are as well conditioned as the others. s makes the problem solvable whatever the gaps are; its price is so high that
it stays zero unless the rows contradict each other (an exact penalty).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.discretization import ContactPoints, Nominal
from tolcontact.discretization.nominal import movers
from tolcontact.method import Method
from tolcontact.symbolic.correction import FREEDOMS, Carried, Twist, corrected, increments, total
from tolcontact.symbolic.gap import gap
from tolcontact.symbolic.objective import MOMENTS, displacement_energy, moment_table
from tolcontact.symbolic.plugins import Plugin, solver
from tolcontact.symbolic.pose import ENTRIES, Pose, pose_of, poses_of, relative

SLOTS = 12
SLACK = 1e-3
FAR = 1e3
INPUTS = ("poses", "moments", "P_m", "P_r", "n_r", "filled")
OUTPUTS = ("corrected", "linearized", "multipliers", "stationarity", "natural_residual", "slack")


@dataclass(frozen=True, eq=False)
class Side:
    """One side of a pair whose points can be displaced: where they are, and the part that they belong to."""

    pair: int
    part: int
    points: np.ndarray
    centre: np.ndarray

    @property
    def table(self) -> np.ndarray:
        """Shape (moment, point)."""
        return moment_table(self.points, self.centre)


@dataclass(frozen=True, eq=False)
class Group:
    """Parts that contact couples to each other, and the fixed parts that they touch.

    parts, pairs     indices into the nominal model's
    free             indices of the movers among all parts
    carried          one per part of `parts`
    sides            sides of pairs that enter the objective, in the order of the Function's moments
    length           root mean square distance of the contact points from their centroid [mm]
    """

    parts: tuple[int, ...]
    pairs: tuple[int, ...]
    free: tuple[int, ...]
    carried: tuple[Carried, ...]
    sides: tuple[Side, ...]
    length: float


def contact_groups(nominal: Nominal) -> list[Group]:
    """The groups of parts that contact couples: what touches only fixed parts in common stays apart."""
    chains = [tuple(nominal.part_index(mover) for mover in movers(nominal.assembly, part.part)) for part in nominal.parts]
    clusters: list[set[int]] = []
    for pair in nominal.pairs:
        joined = set(chains[pair.moving]) | set(chains[pair.reference])
        for cluster in [c for c in clusters if c & joined]:
            clusters.remove(cluster)
            joined |= cluster
        clusters.append(joined)
    return [_group(nominal, chains, tuple(sorted(cluster))) for cluster in clusters]


def _group(nominal: Nominal, chains: Sequence[tuple[int, ...]], free: tuple[int, ...]) -> Group:
    own = [
        (index, pair) for index, pair in enumerate(nominal.pairs) if {*chains[pair.moving], *chains[pair.reference]} & set(free)
    ]
    moved = {part for part, chain in enumerate(chains) if {*chain} & {*free}}
    parts = tuple(sorted(moved.union(*((pair.moving, pair.reference) for _, pair in own))))
    points: dict[int, list[np.ndarray]] = {part: [] for part in parts}
    for _, pair in own:
        points[pair.moving].append(pair.P_m)
        points[pair.reference].append(pair.P_r)
    # A part without contact points of its own turns about those of the last part that moves it.
    centre = {part: np.vstack(points[part] or points[chains[part][-1]]).mean(axis=0) for part in parts}
    references = {pair.reference for _, pair in own}
    sides = [
        Side(position, parts.index(part), P, centre[part])
        for position, (_, pair) in enumerate(own)
        for part, P in ((pair.moving, pair.P_m), (pair.reference, pair.P_r))
        if chains[part]
    ]
    every = np.vstack([pair.P_m for _, pair in own])
    length = float(np.sqrt(((every - every.mean(axis=0)) ** 2).sum(axis=1).mean()))
    return Group(
        parts=parts,
        pairs=tuple(index for index, _ in own),
        free=free,
        carried=tuple(
            Carried(tuple(free.index(mover) for mover in chains[part]), centre[part], part in references) for part in parts
        ),
        sides=tuple(sides),
        length=length or 1.0,
    )


def contact_program(nominal: Nominal, group: Group, method: Method, plugin: Plugin) -> ca.Function:
    """The Function of a group; named inputs and outputs, for `p` parts, `f` movers, `q` pairs, `k` = q * SLOTS rows.

    poses (12 p)         raw poses of the group's parts
    moments (10, sides)  moments of the active points of each side
    P_m, P_r, n_r (3, k) the contact points whose gaps are constrained, SLOTS for each pair
    filled (k)           1 where a slot holds a point, 0 where it is empty

    corrected (12 p)     poses after the correction
    linearized (12 q)    X_RM of every pair, linear in the increments: what the QP constrains
    multipliers (k)      of the rows, >= 0 [mm]
    stationarity, natural_residual   KKT residuals [mm]: max |Hz + f - A'lambda| and max |min(row, lambda)|
    slack                penetration that no increment could remove, to first order [mm]
    """
    pairs = [nominal.pairs[index] for index in group.pairs]
    rows = SLOTS * len(pairs)
    inputs = [
        ca.SX.sym("poses", ENTRIES * len(group.parts)),
        ca.SX.sym("moments", MOMENTS, len(group.sides)),
        *(ca.SX.sym(name, 3, rows) for name in ("P_m", "P_r", "n_r")),
        ca.SX.sym("filled", rows),
    ]
    assemble, finish = _around_the_solver(group, pairs, method, inputs)
    h, a = assemble.sparsity_out("h"), assemble.sparsity_out("a")
    qp = solver(plugin, h, a)
    size = h.size1()
    arguments = [ca.MX.sym(name, *symbol.shape) for name, symbol in zip(INPUTS, inputs, strict=True)]
    H, A, lower, U = assemble(*arguments)
    cost = np.zeros(size)
    cost[-1] = group.length
    at_least = np.full(size, -np.inf)
    at_least[-1] = 0.0
    solved = qp(
        h=H, g=cost, a=A, lba=lower, uba=np.full(rows, np.inf), lbx=at_least, ubx=np.full(size, np.inf),
        x0=np.zeros(size), lam_x0=np.zeros(size), lam_a0=np.zeros(rows),
    )  # fmt: skip
    results = finish(*arguments, H, A, lower, U, solved["x"], solved["lam_a"], solved["lam_x"])
    return ca.Function("contact", arguments, list(results), list(INPUTS), list(OUTPUTS))


def _around_the_solver(
    group: Group, pairs: Sequence[ContactPoints], method: Method, inputs: list[ca.SX]
) -> tuple[ca.Function, ca.Function]:
    """What stands before and after the solver: (inputs -> H, A, lower bound, U) and (those, solution -> outputs)."""
    entries, moments, P_m, P_r, n_r, filled = inputs
    raw = poses_of(entries)
    z = ca.SX.sym("z", FREEDOMS * len(group.free))
    at_rest = ca.SX.zeros(z.shape)
    position = {part: k for k, part in enumerate(group.parts)}
    centres = [raw[position[part]].place(ca.DM(group.carried[position[part]].centre)) for part in group.free]
    moves = increments(z, group.length, centres)
    twists = [total(part, X, moves) for part, X in zip(group.carried, raw, strict=True)]
    poses = [corrected(*each) for each in zip(group.carried, raw, twists, strict=True)]

    rows, constants, linearized = [], [], []
    for k, pair in enumerate(pairs):
        moving, reference = position[pair.moving], position[pair.reference]
        X_RM = relative(poses[moving], poses[reference]).vector()
        by_z = ca.substitute(ca.jacobian(X_RM, z), z, at_rest)
        now = relative(raw[moving], raw[reference]).vector()
        linearized.append(now + by_z @ z)
        for slot in range(k * SLOTS, (k + 1) * SLOTS):
            X = ca.SX.sym("X_RM", ENTRIES)
            g = gap(pose_of(X), P_m[:, slot], P_r[:, slot], n_r[:, slot])
            rows.append(ca.substitute(ca.jacobian(g, X), X, now) @ by_z)
            constants.append(ca.substitute(g, X, now))
    H, U = _conditioned(_objective(group, method, moments, raw, moves, twists, z))
    A = ca.horzcat(ca.solve(U.T, ca.vertcat(*rows).T).T, ca.DM(np.full(len(rows), SLACK)))
    idle, far = _idle_rows(*A.shape), -FAR * group.length
    A = ca.if_else(ca.repmat(filled, 1, A.size2()), A, idle)
    lower = ca.if_else(filled, -ca.vertcat(*constants), far)
    H = ca.diagcat(H, 1)
    assemble = ca.Function("assemble", inputs, [H, A, lower, U], list(INPUTS), ["h", "a", "lower", "u"])

    x = ca.SX.sym("x", z.numel() + 1)
    lam_a, lam_x = ca.SX.sym("lam_a", len(rows)), ca.SX.sym("lam_x", x.numel())
    # The results get the QP's matrices as inputs, so that nothing is computed twice and the residuals are of what was solved.
    H_in, A_in, U_in = (ca.SX.sym("M", matrix.sparsity()) for matrix in (H, A, U))
    lower_in = ca.SX.sym("lower", len(rows))
    price = ca.vertcat(ca.SX.zeros(z.numel()), group.length)
    stationarity = ca.norm_inf(H_in @ x + price + A_in.T @ lam_a + lam_x)
    natural = ca.norm_inf(ca.fmin(A_in @ x - lower_in, -lam_a))
    results = [
        ca.vertcat(*(pose.vector() for pose in poses)),
        ca.vertcat(*linearized),
        -lam_a * filled,
        stationarity,
        ca.fmax(natural, ca.fabs(ca.fmin(x[-1], -lam_x[-1]))),
        SLACK * x[-1],
    ]
    step = ca.solve(U_in, x[:-1])
    results = [ca.substitute(result, z, step) for result in results]
    finish = ca.Function("finish", [*inputs, H_in, A_in, lower_in, U_in, x, lam_a, lam_x], results)
    return assemble, finish


def _idle_rows(rows: int, columns: int) -> ca.DM:
    """Rows for empty slots, in general position; with a bound far away they never bind.

    Rows of zeros would do for other plugins, but qpOASES starts from the rows that carried in the previous problem, and
    fails where one of those has become zero.
    """
    directions = np.random.default_rng(0).normal(size=(rows, columns))
    directions[:, -1] = 0
    return ca.DM(directions / np.linalg.norm(directions, axis=1, keepdims=True))


def _conditioned(Q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """H = U^-T Q U^-1 with unit diagonal blocks, and U, block diagonal and upper triangular."""
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


def _objective(
    group: Group,
    method: Method,
    moments: ca.SX,
    raw: Sequence[Pose],
    moves: Sequence[Twist],
    twists: Sequence[Twist],
    z: ca.SX,
) -> ca.SX:
    """Q of (11) in the variables z, divided by the number of active points."""
    energy = ca.SX(0)
    for k, side in enumerate(group.sides):
        energy += displacement_energy(moments[:, k], side.centre, raw[side.part], twists[side.part])
        if method.regularization == "points":
            everything = ca.SX(side.table.sum(axis=1))
            own = moves[group.carried[side.part].movers[-1]]
            energy += method.eta * displacement_energy(everything, side.centre, raw[side.part], own)
    if method.regularization == "identity":
        for part, move in zip(group.free, moves, strict=True):
            dt = move.at(raw[group.parts.index(part)].t)
            energy += method.eta * (ca.dot(dt, dt) + ca.dot(move.W, move.W)) / 2
    active = ca.fmax(ca.sum2(moments[0, :]), 1)
    H, _ = ca.hessian(energy / active, z)
    return H
