"""The contact QP of one group of parts, as one CasADi Function, paper (9) to (12).

min 1/2 y'Hy + f'y + sum (L s_k + 1/2 s_k^2)   subject to   g_i + A_i y + SLACK s_k >= 0,  h_j + B_j y = 0,  s_k >= 0

The increments z = (dt, L w) of a mover, all in mm (L is a length of the group's size), are z = U^-1 y, where U'U is the
mover's own block of (11): H then has unit blocks on its diagonal, and the few freedoms that only the regularization holds
are as well conditioned as the others. s_k, one for each pair k, make the problem solvable whatever the gaps are; their
price is so high that they stay zero unless the rows contradict each other (an exact penalty). f, the pull of the
objective at the present poses, is zero in the raw state but for forces; h are the two-sided locators, where the
objective holds them.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.compilation.plugins import Plugin, solver
from tolcontact.discretization import ContactPoints, Nominal
from tolcontact.mechanics.correction import FREEDOMS, increments, linear, published, quadratic, rigid
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.gap import gap
from tolcontact.mechanics.gap_map import GapMap
from tolcontact.mechanics.groups import Group, round_pairs
from tolcontact.mechanics.objective import criterion, proximity, two_sided
from tolcontact.mechanics.pose import ENTRIES, Pose, pose_of, poses_of, relative
from tolcontact.method import Method

SLOTS = 12
SLACK = 1e-3
FAR = 1e3
INPUTS = (
    "poses", "raw", "moments", "deviations", "firmness", "newton", "stride", "caution", "reactions", "bend",
    "P_m", "P_r", "n_r", "filled",
)  # fmt: skip
ENERGY_INPUTS = ("poses", "raw", "moments", "deviations")
OUTPUTS = ("corrected", "linearized", "relative", "multipliers", "residual", "slack", "step", "astray")


@dataclass(frozen=True, eq=False)
class ContactProgram:
    """The Functions of a group: `assemble` makes the QP of the inputs, `plugin` solves it, `finish` makes the outputs.

    energy       the objective at `poses` (realization, 1) [mm^2], or [mm] for seating: of poses, raw, moments, deviations
    slacks       how many of the QP's last variables are slacks: they are not negative
    equalities   how many of its last rows are equations: two-sided locators, where the objective holds them
    standing     for each pair of the group the contact points that always have a row, None where slots hold changing points
    """

    assemble: ca.Function
    plugin: Plugin
    finish: ca.Function
    energy: ca.Function
    slacks: int
    equalities: int
    standing: tuple[np.ndarray | None, ...]

    def qp(self, plugin: Plugin) -> ca.Function:
        """A new solver of a plugin, without memory of any problem."""
        return solver(plugin, self.assemble.sparsity_out("h"), self.assemble.sparsity_out("a"))

    @property
    def spans(self) -> list[slice]:
        """The rows of each pair among those of the group."""
        ends = np.cumsum([0, *(SLOTS if points is None else len(points) for points in self.standing)])
        return [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]


def contact_program(nominal: Nominal, group: Group, gaps: Sequence[GapMap], method: Method, plugin: Plugin) -> ContactProgram:
    """The Functions of a group; their inputs and outputs, for `p` parts, `f` movers, `q` pairs, `k` rows.

    Where few points of a pair can be the deepest each of them has a row, always. The `v` other pairs have SLOTS rows each, for
    points that change: `m` = v * SLOTS.

    poses (12 p)         poses of the group's parts about which the gaps are linearized
    raw (12 p)           their raw poses, from which displacements count
    moments (10, sides)  moments of the points of each side that count in the objective
    deviations (l)       of all locators of the model [mm]
    firmness             1, or more to hold the freedoms that the objective leaves open more firmly than it will in the end
    newton               1 to count the curvature of objective and gaps, 0 for the linear step of the paper
    stride               in an exact resolution: of the step no more is taken than turns a mover by this angle [rad]
    caution              where points are projected anew: weight of the step itself, in all contact points, beside the objective
    reactions (k)        where it counts: the reaction that a row's point had before
    bend (12 v)          where it counts: the sum, over the points that slots held before, of reaction times the gap's gradient
                         by the entries of X_RM
    P_m, P_r, n_r (3, m) the contact points in the slots
    filled (m)           1 where a slot holds a point, 0 where it is empty

    corrected (12 p)     poses after the correction; in an exact resolution after as much of it as `stride` allows
    linearized (12 q)    X_RM of every pair, linear in the increments: what the QP constrains
    relative (12 q)      X_RM of every pair at `corrected`
    multipliers (k)      reactions: of the rows, >= 0, in the units of the objective (see Criterion)
    residual             KKT residual [mm], in y: the larger of max |Hy + f - A'lambda|, and max |min(row, lambda)| with rows
                         of length 1, or how far a gap remains negative
    slack (q)            penetration of each pair that no increment could remove, to first order [mm]
    step (2)             largest increment (dt, L w) of a mover [mm], and the same in the norm of the objective, max |y|; of
                         the whole correction
    astray               how far two-sided locators, where they hold, are from their place at `corrected` [mm]
    """
    standing = tuple(_standing(gaps[index], method) for index in group.pairs)
    varying = sum(points is None for points in standing)
    slots = SLOTS * varying
    rows = slots + sum(len(points) for points in standing if points is not None)
    inputs = [
        ca.SX.sym("poses", ENTRIES * len(group.parts)),
        ca.SX.sym("raw", ENTRIES * len(group.parts)),
        ca.SX.sym("moments", MOMENTS, len(group.sides)),
        ca.SX.sym("deviations", len(nominal.locator_labels)),
        ca.SX.sym("firmness"),
        ca.SX.sym("newton"),
        ca.SX.sym("stride"),
        ca.SX.sym("caution"),
        ca.SX.sym("reactions", rows),
        ca.SX.sym("bend", ENTRIES * varying),
        *(ca.SX.sym(name, 3, slots) for name in ("P_m", "P_r", "n_r")),
        ca.SX.sym("filled", slots),
    ]
    assemble, finish, energy, held = _around_the_solver(nominal, group, standing, method, inputs)
    return ContactProgram(assemble, plugin, finish, energy, len(group.pairs), held, standing)


def _standing(gaps: GapMap, method: Method) -> np.ndarray | None:
    """The points of a pair that always have a row: those that can be the deepest, where they are few and stay the same."""
    stays = method.search == "fixed" and method.active_set == "closed"
    return gaps.corners if stays and len(gaps.corners) <= SLOTS else None


def _around_the_solver(
    nominal: Nominal, group: Group, standing: Sequence[np.ndarray | None], method: Method, inputs: list[ca.SX]
) -> tuple[ca.Function, ca.Function, ca.Function, int]:
    """What stands before and after the solver: (inputs -> H, f, A, bounds, U) and (those, solution -> outputs).

    Besides the objective, and the number of two-sided locators that are held.
    """
    entries, raw_entries, moments, deviations, firmness, newton, stride, caution, reactions, bend, *slotted = inputs
    P_m, P_r, n_r, filled = slotted
    now, raw = poses_of(entries), poses_of(raw_entries)
    z = ca.SX.sym("z", FREEDOMS * len(group.free))
    at_rest = ca.SX.zeros(z.shape)
    centres = [now[k].place(ca.DM(group.carried[k].centre)) for k in map(group.position, group.free)]
    moves = increments(z, group.length, centres)
    moved = [linear(part, X, moves) for part, X in zip(group.carried, now, strict=True)]
    update = rigid if method.resolution == "exact" else published
    poses = [update(part, X, moves) for part, X in zip(group.carried, now, strict=True)]

    owners: list[int] = []
    rows: list[ca.SX] = []
    constants, fills, bends, linearized = ([] for _ in range(4))
    in_slots = iter(zip(*(ca.horzsplit(each) for each in (P_m, P_r, n_r, filled.T)), strict=True))
    slot_bends = iter(ca.vertsplit(bend, ENTRIES) if bend.numel() else [])
    for k, (before, after) in enumerate(zip(_pairs(nominal, group, now), _pairs(nominal, group, moved), strict=True)):
        by_z = ca.substitute(ca.jacobian(after.vector(), z), z, at_rest)
        linearized.append(before.vector() + by_z @ z)
        held_here = standing[k]
        if held_here is None:
            points = list(itertools.islice(in_slots, SLOTS))
            bends.append(next(slot_bends))
        else:
            points = _always(nominal.pairs[group.pairs[k]], held_here, deviations)
            bends.append(ca.SX.zeros(ENTRIES))
        for p_m, p_r, n, is_filled in points:
            X = ca.SX.sym("X_RM", ENTRIES)
            g = gap(pose_of(X), p_m, p_r, n)
            slope = ca.substitute(ca.jacobian(g, X), X, before.vector())
            if held_here is not None:
                bends[k] += slope.T * reactions[len(rows)]
            rows.append(slope @ by_z)
            constants.append(ca.substitute(g, X, before.vector()))
            fills.append(is_filled)
            owners.append(k)
    slots = len(rows)
    fill = ca.vertcat(*fills)
    held, elongation = _held(nominal, group, moved, deviations, z) if method.objective == "seating" else (0, ca.SX(0, 1))
    goal = criterion(nominal, group, method, moments, firmness, raw, moved, z)
    Q, pull = (ca.substitute(each, z, at_rest) for each in ca.hessian(goal.energy, z))
    A, g = ca.vertcat(*rows), ca.vertcat(*constants)
    if method.resolution == "exact":
        curved = [quadratic(part, X, moves) for part, X in zip(group.carried, now, strict=True)]
        curvature = _curvature(nominal, group, method, moments, firmness, raw, curved, z, ca.vertcat(*bends) / goal.scale) - Q
        # Rows that carry are held in the objective, too: it does not change the answer, and makes it convex again, or nearly:
        # what is checked are the freedoms of each mover, not those of several together.
        hold = (1 + 2 * ca.sum1(reactions) / goal.scale / group.length) * ca.if_else(reactions > 0, fill, 0)
        curvature += A.T @ ca.diag(hold) @ A
        counts = ca.logic_and(newton, _is_convex(Q + curvature))
        Q += ca.if_else(counts, curvature, 0)
        pull += ca.if_else(counts, A.T @ (hold * g), 0)
    if method.resolution == "exact" and (method.search == "iterated" or round_pairs(nominal, group)):
        Q += caution * ca.substitute(ca.hessian(proximity(group, now, moved, z), z)[0], z, at_rest) / group.length
    H, U = _conditioned(Q)
    whiten = _whitening(U)
    A = A @ whiten
    # Rows of length 1 in y: multipliers are then in the norm of the objective, however weakly that holds a freedom.
    length = ca.sqrt(ca.sum2(A**2))
    length = ca.if_else(length > 0, length, 1)
    A = ca.diag(1 / length) @ A
    A = ca.vertcat(*(A[k, :] if fill[k].is_one() else _or_idle(fill[k], A[k, :], k) for k in range(slots)))
    B = ca.substitute(ca.jacobian(elongation, z), z, at_rest) @ whiten
    pairs = len(group.pairs)
    opens = ca.sparsify(ca.DM(np.equal.outer(owners, range(pairs)).astype(float)))
    A = ca.blockcat([[A, ca.diag(SLACK / length) @ opens], [B, ca.SX(held, pairs)]])
    rest = -ca.substitute(elongation, z, at_rest)
    lower = ca.vertcat(ca.if_else(fill, -g / length, -FAR * group.length), rest)
    upper = ca.vertcat(ca.DM(np.full(slots, np.inf)), rest)
    f = ca.vertcat(whiten.T @ pull, ca.DM(np.full(pairs, group.length)))
    H = ca.diagcat(H, ca.SX.eye(pairs))
    problem = [H, f, A, lower, upper, U, length]
    assemble = ca.Function("assemble", inputs, problem, list(INPUTS), ["h", "g", "a", "lower", "upper", "u", "length"])

    size = z.numel() + pairs
    x, lam_a, lam_x = ca.SX.sym("x", size), ca.SX.sym("lam_a", slots + held), ca.SX.sym("lam_x", size)
    y, s, lam_s = x[: z.numel()], x[z.numel() :], lam_x[z.numel() :]
    # The results get the QP's matrices as inputs, so that nothing is computed twice and the residuals are of what was solved.
    H_in, A_in, U_in = (ca.SX.sym("M", matrix.sparsity()) for matrix in (H, A, U))
    f_in, lower_in, length_in = (ca.SX.sym("v", vector.shape) for vector in (f, lower, length))
    excess = A_in @ x - lower_in
    natural = ca.vertcat(ca.fmin(excess[:slots], -lam_a[:slots]), ca.fmin(s, -lam_s), ca.fmin(excess[:slots] * length_in, 0))
    residuals = [ca.norm_inf(natural), *([ca.norm_inf(excess[slots:])] if held else [])]
    results = [
        ca.vertcat(*(pose.vector() for pose in poses)),
        ca.vertcat(*linearized),
        ca.vertcat(*(X_RM.vector() for X_RM in _pairs(nominal, group, poses))),
        -lam_a[:slots] / length_in * fill * goal.scale,
        ca.mmax(ca.vertcat(ca.norm_inf(H_in @ x + f_in + A_in.T @ lam_a + lam_x), *residuals)),
        SLACK * s,
        ca.vertcat(ca.norm_inf(z), ca.norm_inf(y)),
        ca.norm_inf(_held(nominal, group, poses, deviations)[1]) if held else ca.SX(0),
    ]
    step = _whitening(U_in) @ y
    taken = {"corrected": step, "relative": step, "astray": step}
    if method.resolution == "exact":
        turns = ca.vertcat(*(step[k + 3 : k + FREEDOMS] for k in range(0, step.numel(), FREEDOMS)))
        taken = dict.fromkeys(taken, step * ca.fmin(1, stride * group.length / ca.norm_inf(turns)))
    results = [ca.densify(ca.substitute(it, z, taken.get(name, step))) for name, it in zip(OUTPUTS, results, strict=True)]
    finish = ca.Function("finish", [*inputs, H_in, f_in, A_in, lower_in, U_in, length_in, x, lam_a, lam_x], results)
    least = ca.substitute(ca.substitute(goal.energy, z, at_rest), firmness, 1)
    energy = ca.Function("energy", [entries, raw_entries, moments, deviations], [least], list(ENERGY_INPUTS), ["energy"])
    return assemble, finish, energy, held


def _always(pair: ContactPoints, points: np.ndarray, deviations: ca.SX) -> list[tuple[ca.SX, ...]]:
    """P^m, P^r, n^r of points that have a row whatever happens, and that it is filled: constants, but for supports' heights."""
    P_m, P_r, n_r = (ca.SX(ca.DM(each[points].T)) for each in (pair.P_m, pair.P_r, pair.n_r))
    if pair.locators is not None:
        P_r = P_r + n_r @ ca.diag(deviations[[int(column) for column in pair.locators[points]]])
    return list(zip(*(ca.horzsplit(each) for each in (P_m, P_r, n_r, ca.SX.ones(1, len(points)))), strict=True))


def _curvature(
    nominal: Nominal,
    group: Group,
    method: Method,
    moments: ca.SX,
    firmness: ca.SX,
    raw: Sequence[Pose],
    poses: Sequence[Pose],
    z: ca.SX,
    bend: ca.SX,
) -> ca.SX:
    """Hessian of the Lagrangian at z = 0: of the objective less the reactions' work on the gaps (linear in X_RM)."""
    energy = criterion(nominal, group, method, moments, firmness, raw, poses, z).energy
    work = ca.dot(bend, ca.vertcat(*(X_RM.vector() for X_RM in _pairs(nominal, group, poses))))
    H, _ = ca.hessian(energy - work, z)
    return ca.substitute(H, z, ca.SX.zeros(z.shape))


def _is_convex(Q: ca.SX) -> ca.SX:
    """Whether the diagonal blocks of Q are positive definite; a NaN among the pivots is not."""
    blocks = (ca.densify(Q[k : k + FREEDOMS, k : k + FREEDOMS]) for k in range(0, Q.size1(), FREEDOMS))
    pivots = ca.vertcat(*(ca.diag(ca.chol(block)) for block in blocks))
    return ca.mmin(ca.if_else(pivots > 0, 1, 0))


def _pairs(nominal: Nominal, group: Group, poses: Sequence[Pose]) -> list[Pose]:
    """X_RM of the group's pairs."""
    pairs = [nominal.pairs[index] for index in group.pairs]
    return [
        poses[group.position(pair.moving)]
        if pair.reference is None
        else relative(poses[group.position(pair.moving)], poses[group.position(pair.reference)])
        for pair in pairs
    ]


def _held(
    nominal: Nominal, group: Group, poses: Sequence[Pose], deviations: ca.SX, z: ca.SX | None = None
) -> tuple[int, ca.SX]:
    """How far the two-sided locators of the free parts are from where they hold their part [mm], and their number.

    To first order in `z`, if that is given.
    """
    labels = np.cumsum([0, *(len(part.labels) for part in nominal.parts)])
    apart = []
    for part in group.free:
        columns = labels[part] + np.flatnonzero(~nominal.parts[part].one_sided)
        if columns.size:
            apart.append(two_sided(nominal, group, part, poses, z) - deviations[[int(c) for c in columns]])
    elongation = ca.vertcat(*apart) if apart else ca.SX(0, 1)
    return elongation.numel(), elongation


def _or_idle(filled: ca.SX, row: ca.SX, seed: int) -> ca.SX:
    """A row, or where its slot is empty one in general position that with a bound far away never binds.

    Rows of zeros would do for other plugins, but qpOASES starts from the rows that carried in the previous problem, and
    fails where one of those has become zero.
    """
    idle = np.random.default_rng(seed).normal(size=row.nnz())
    return ca.SX(row.sparsity(), ca.if_else(filled, row.T.nz[:], ca.DM(idle / np.linalg.norm(idle))))


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


def _whitening(U: ca.SX) -> ca.SX:
    """U^-1, block by block: z = U^-1 y."""
    movers = range(0, U.size1(), FREEDOMS)
    return ca.diagcat(*(ca.solve(U[k : k + FREEDOMS, k : k + FREEDOMS], ca.SX.eye(FREEDOMS)) for k in movers))
