"""A solver of contact QPs that exploits the graph of bodies: few bodies touch each other, so the matrices are sparse.

Its layout of a QP states the bodies that each row touches, and the elimination order of joints. A joint is the set of rows that
share a slack (the rows of a contact pair), or a set of equations that touch the same bodies.
"""

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Bool, Float
from tolcontact.compilation.contact_qp import ContactQP
from tolcontact.compilation.elastic_solver import ElasticSolver
from tolcontact.compilation.graph.factor_kernel import Work
from tolcontact.compilation.graph.solve_kernel import solve_batch
from tolcontact.compilation.solver import Arrays, SolverChoice
from tolcontact.mechanics.correction import FREEDOMS

FEW_BODIES, ROUNDS_OF_FEW, ROUNDS = 2, 4, 40  # rounds of all joints at once
STEPS_PER_ROW = 4  # steps of single rows

Key = Callable[[int, Sequence[int], Sequence[set[int]]], tuple[int, ...]]


class Layout(NamedTuple):
    """Constant arrays for the solution of QPs. Bodies, joints and rows are numbered in elimination order.

    blocks      (row, 1 + block) number of bodies that the row touches, and these bodies, in ascending order
    joint       (row,) the joint of the row; the rows of a joint are consecutive
    source      (row,) its index in the QP
    row         (joint + 1,) the first row of the joint
    first       (joint + 1,) its first position in the Gram matrix of the active rows
    slack       (joint,) its slack, or -1 for equations
    prior_start (joint + 1,) its first row of `prior`
    prior       (_, 2) earlier joints that share entries of the Gram factor with the joint, and whether the two share a body, so
                that the Gram matrix has entries, too
    bodies      (body,) index of each body in the QP
    entries     (nonzero of a) offset of each nonzero in a buffer: slopes (row, block, 6), then openings (row,)
    hessian_entries (nonzero of h) offset of each nonzero in the lower triangular blocks (block, 6, 6) of H, or -1
    starts      (body + 1,) first block of each body's row; its last block is on the diagonal
    columns     (block,) body of each block's column
    block_of    (body, body) block of a row and column, or -1
    """

    blocks: np.ndarray
    joint: np.ndarray
    source: np.ndarray
    row: np.ndarray
    first: np.ndarray
    slack: np.ndarray
    prior_start: np.ndarray
    prior: np.ndarray
    bodies: np.ndarray
    entries: np.ndarray
    hessian_entries: np.ndarray
    starts: np.ndarray
    columns: np.ndarray
    block_of: np.ndarray


class GraphChoice(SolverChoice):
    """The choice of the solver on the graph of bodies."""

    def is_usable(self) -> bool:
        """Return True: the solver is part of this package."""
        return True

    def solver(self, qp: ContactQP) -> "GraphSolver | ElasticSolver":
        if qp.flexibility is not None:
            return ElasticSolver(qp)
        sparsities = {name: qp.sparsity(name) for name in ("h", "g", "a", "lba")}
        return GraphSolver(sparsities, slacks=qp.slacks, equations=qp.equations)


class GraphSolver:
    """A solver of QPs with the sparsities of h, g, a and lba. Threads must not share it.

    The last `equations` rows are equations. The last `slacks` variables are not negative, with unit entries in h. Twins share
    their layouts, which are created on demand.

    remembers   whether it starts each problem from the previous answer: never
    """

    remembers = False

    def __init__(self, sparsities: Mapping[str, ca.Sparsity], *, slacks: int, equations: int) -> None:
        self._layouts: dict[bool, Layout] = {}  # by whether H couples bodies
        self._sparsities, self._slacks, self._equations = dict(sparsities), slacks, equations
        rows, columns = (np.array(indices) for indices in sparsities["h"].get_triplet())
        self._identity = (rows == columns).astype(float)
        self._nonzeros = {name: np.array(sparsities[name].find()) for name in ("g", "lba")}
        self._buffers: dict[bool, tuple[Work, np.ndarray, np.ndarray]] = {}

    def __call__(
        self, problem: Arrays, reactions: Float[Array, "realization row"], slacks: Float[Array, "realization slack"]
    ) -> tuple[dict[str, Float[Array, "realization _"]], Bool[Array, " realization"]]:
        """Return x, lam_a and lam_x of assembled QPs, (realization, entry), and (realization,) whether the solver failed.

        In the initial active set, rows with `reactions` are active, and `slacks` above zero are open.
        """
        count = len(reactions)
        assert slacks.shape == (count, self._slacks)  # otherwise machine code would read out of bounds
        rows, size = self._sparsities["a"].shape
        answer = {name: np.zeros((count, entries)) for name, entries in (("x", size), ("lam_a", rows), ("lam_x", size))}
        failed = np.zeros(count, dtype=np.bool_)
        arrays = (problem["h"], problem["a"], self._full("g", problem["g"]), self._full("lba", problem["lba"]))
        guess, results = (reactions, slacks), (*answer.values(), failed)
        coupled = (problem["h"] != self._identity).any(axis=1)
        for is_coupled in (False, True):
            members = np.flatnonzero(coupled == is_coupled)
            if len(members) == count:
                self._solve(is_coupled, arrays, guess, results)
            elif members.size:
                parts = [tuple(array[members] for array in group) for group in (arrays, guess, results)]
                self._solve(is_coupled, *parts)
                for array, values in zip(results, parts[2], strict=True):
                    array[members] = values
        return answer, failed

    def twin(self) -> "GraphSolver":
        """Return an equal solver with buffers of its own."""
        twin = copy.copy(self)
        twin._buffers = {}
        return twin

    def _full(self, name: str, stored: np.ndarray) -> np.ndarray:
        """Return all entries of a vector, (realization, entry)."""
        size = self._sparsities[name].numel()
        if stored.shape[1] == size:
            return stored
        entries = np.zeros((len(stored), size))
        entries[:, self._nonzeros[name]] = stored
        return entries

    def _solve(
        self, coupled: bool, problem: tuple[np.ndarray, ...], guess: tuple[np.ndarray, ...], answer: tuple[np.ndarray, ...]
    ) -> None:
        """Solve QPs (h, a, g, lba) into `answer` (x, lam_a, lam_x, failed); they are `coupled` if H has off-diagonal blocks.

        guess   reactions and slacks
        """
        if coupled not in self._layouts:
            h, a = self._sparsities["h"], self._sparsities["a"]
            self._layouts[coupled] = layout(h, a, slacks=self._slacks, equations=self._equations, coupled=coupled)
        arrays = self._layouts[coupled]
        if coupled not in self._buffers:
            self._buffers[coupled] = _buffers(arrays, coupled)
        work, buffer, blocks = self._buffers[coupled]
        rows, bodies, joints = len(work.bound), len(work.y), len(work.open)
        rounds = max(ROUNDS, bodies) if bodies > FEW_BODIES else ROUNDS_OF_FEW
        nonzeros, *vectors = (np.ascontiguousarray(array) for array in problem)
        solve_batch(
            arrays,
            work,
            (nonzeros if coupled else nonzeros[:, :0].copy(), blocks),
            (*vectors, buffer),
            tuple(np.ascontiguousarray(array) for array in guess),
            np.array([rounds, STEPS_PER_ROW * (rows + FREEDOMS)]),
            (np.zeros(joints), np.zeros(joints, dtype=np.int64), np.zeros((len(nonzeros), 2), dtype=np.int64)),
            answer,
        )


def _buffers(layout: Layout, coupled: bool) -> tuple[Work, np.ndarray, np.ndarray]:
    """Return the numbers of one QP, the buffer of its slopes and openings, and the buffer (block, 6, 6) of the factor of H."""
    rows, width, bodies = len(layout.blocks), layout.blocks.shape[1] - 1, len(layout.bodies)
    joints, positions, cut = len(layout.slack), int(layout.first[-1]), rows * width * FREEDOMS
    buffer = np.zeros(cut + rows)
    work = Work(
        slopes=buffer[:cut].reshape(rows, width, FREEDOMS),
        opening=buffer[cut:],
        bound=np.zeros(rows),
        position=np.zeros(rows, dtype=np.int64),
        **{name: np.zeros((bodies, FREEDOMS)) for name in ("gradient", "y", "scatter", "direction")},
        **{name: np.zeros(joints, dtype=np.int64) for name in ("counts", "fresh", "changed", "open")},
        **{name: np.zeros(joints) for name in ("price", "value", "change")},
        factor=np.zeros((positions, positions)),
        active=np.zeros(positions, dtype=np.int64),
        **{name: np.zeros(positions) for name in ("multiplier", "step", "column")},
    )
    return work, buffer, np.zeros((len(layout.columns) if coupled else 0, FREEDOMS, FREEDOMS))


def layout(h: ca.Sparsity, a: ca.Sparsity, *, slacks: int, equations: int, coupled: bool) -> Layout:
    """Return the layout of QPs with these sparsities.

    If `coupled`, H = C C' has off-diagonal blocks. Rows become C^-1 a, which also touches the bodies that follow in the factor.
    """
    bodies, count = (h.size1() - slacks) // FREEDOMS, a.size1()
    rows, columns = (np.array(indices, dtype=np.int64) for indices in a.get_triplet())
    of_body = columns < bodies * FREEDOMS
    touched: list[set[int]] = [set() for _ in range(count)]
    for row, column in zip(rows[of_body].tolist(), columns[of_body].tolist(), strict=True):
        touched[row].add(column // FREEDOMS)
    slack_of_row = np.full(count, -1)
    slack_of_row[rows[~of_body]] = columns[~of_body] - bodies * FREEDOMS
    graph: list[set[int]] = [set() for _ in range(bodies)]  # the bodies that H couples to each body
    for row, column in zip(*h.get_triplet(), strict=True) if coupled else ():
        i, j = row // FREEDOMS, column // FREEDOMS
        if i != j and max(i, j) < bodies:
            graph[i].add(j)
            graph[j].add(i)
    # A flat elimination tree: every other node of a chain, and so on recursively.
    body_order, later = elimination(graph, lambda body, depths, graph: (depths[body], len(graph[body]), body))
    if coupled:
        touched = [_with_later(body_order, later, nodes) for nodes in touched]
    joints, equation_joints = _joints(touched, slack_of_row.tolist(), count - equations)
    joint_bodies = [set().union(*(touched[row] for row in members)) for members in joints]
    adjacent = [{k for k, nodes in enumerate(joint_bodies) if k != j and nodes & joint_bodies[j]} for j in range(len(joints))]
    # Equations come first, so that no equation is dropped because it depends on rows that may leave. Then minimum degree, since
    # the factor has few entries; a chain is eliminated from both ends.
    order, joined = elimination(adjacent, lambda j, depths, graph: (j >= equation_joints, len(graph[j]), depths[j], j))
    prior = [sorted(k for k, nodes in enumerate(joined) if j in nodes) for j in range(len(order))]
    members = [joints[j] for j in order]
    row_order = np.array([row for rows_of_joint in members for row in rows_of_joint], dtype=np.int64)
    body_rank = np.argsort(body_order)
    blocks = [sorted(int(body_rank[body]) for body in touched[row]) for row in row_order]
    width = max([1, *map(len, blocks)])
    sizes = [len(joints[j]) if j < equation_joints else min(len(joints[j]), FREEDOMS * len(joint_bodies[j]) + 2) for j in order]
    prior_joints = [(k, order[k] in adjacent[order[j]]) for j, nodes in enumerate(prior) for k in nodes]
    return Layout(
        blocks=np.array([[len(nodes), *nodes] + [0] * (width - len(nodes)) for nodes in blocks], dtype=np.int64),
        joint=np.repeat(np.arange(len(order)), list(map(len, members))),
        source=row_order,
        row=_starts(members),
        first=np.cumsum([0, *sizes]),
        slack=np.array([slack_of_row[rows_of_joint[0]] for rows_of_joint in members], dtype=np.int64),
        prior_start=_starts(prior),
        prior=np.array(prior_joints, dtype=np.int64).reshape(-1, 2),
        bodies=np.array(body_order, dtype=np.int64),
        entries=_entries(rows, columns, np.argsort(row_order), body_rank, blocks, width),
        **_hessian_blocks(h, body_rank, later),
    )


def _starts(lists: Sequence[Sequence[int] | set[int]]) -> np.ndarray:
    return np.cumsum([0, *map(len, lists)])


def _with_later(order: Sequence[int], later: Sequence[Sequence[int]], bodies: set[int]) -> set[int]:
    """Return the bodies, and the bodies that follow them in the factor of H."""
    ranks = {order.index(body) for body in bodies}
    for rank in range(len(order)):
        if rank in ranks:
            ranks.update(later[rank])
    return {order[rank] for rank in ranks}


def _joints(touched: Sequence[set[int]], slacks: Sequence[int], inequalities: int) -> tuple[list[list[int]], int]:
    """Return the rows of each joint, joints of equations first, and the number of these."""
    pairs: dict[int, list[int]] = {}
    equations: dict[tuple[int, ...], list[int]] = {}
    for row, (bodies, slack) in enumerate(zip(touched, slacks, strict=True)):
        if row >= inequalities:
            equations.setdefault(tuple(sorted(bodies)), []).append(row)
        else:
            pairs.setdefault(slack, []).append(row)
    return [*equations.values(), *pairs.values()], len(equations)


def _entries(
    rows: np.ndarray, columns: np.ndarray, row_rank: np.ndarray, body_rank: np.ndarray, blocks: Sequence[list[int]], width: int
) -> np.ndarray:
    """Return the offset of each nonzero of a in the buffer of the rows."""
    openings = len(blocks) * width * FREEDOMS
    offsets = np.zeros(len(rows), dtype=np.int64)
    for k, (row, column) in enumerate(zip(row_rank[rows].tolist(), columns.tolist(), strict=True)):
        body, freedom = divmod(column, FREEDOMS)
        if body >= len(body_rank):
            offsets[k] = openings + row
        else:
            offsets[k] = (row * width + blocks[row].index(int(body_rank[body]))) * FREEDOMS + freedom
    return offsets


def _hessian_blocks(h: ca.Sparsity, rank: np.ndarray, later: Sequence[Sequence[int]]) -> dict[str, np.ndarray]:
    """Return the arrays of a layout for the blocks of H, by name."""
    bodies = len(rank)
    columns = [[*(k for k, nodes in enumerate(later) if body in nodes), body] for body in range(bodies)]
    starts = _starts(columns)
    block_of = np.full((bodies, bodies), -1, dtype=np.int64)
    for body, nodes in enumerate(columns):
        block_of[body, nodes] = starts[body] + np.arange(len(nodes))
    rows_of_h, columns_of_h = (np.array(indices, dtype=np.int64) for indices in h.get_triplet())
    offsets = np.full(len(rows_of_h), -1, dtype=np.int64)
    of_bodies = np.flatnonzero(np.maximum(rows_of_h, columns_of_h) < bodies * FREEDOMS)
    i, j = rows_of_h[of_bodies], columns_of_h[of_bodies]
    blocks = block_of[rank[i // FREEDOMS], rank[j // FREEDOMS]]
    offsets[of_bodies] = np.where(blocks < 0, -1, (blocks * FREEDOMS + i % FREEDOMS) * FREEDOMS + j % FREEDOMS)
    order = np.array([k for nodes in columns for k in nodes], dtype=np.int64)
    return {"hessian_entries": offsets, "starts": starts, "columns": order, "block_of": block_of}


def elimination(graph: Sequence[set[int]], key: Key) -> tuple[list[int], list[list[int]]]:
    """Return the order of the nodes, and by rank the ranks of later nodes that elimination joins to the node.

    graph   the neighbours of each node

    The remaining node with the smallest key comes next; its neighbours become neighbours of one another.
    """
    neighbours = [set(nodes) for nodes in graph]
    depths, remaining, order, joined = [0] * len(graph), set(range(len(graph))), [], []
    while remaining:
        node = min(remaining, key=lambda candidate: key(candidate, depths, neighbours))
        remaining.remove(node)
        order.append(node)
        joined.append(neighbours[node])
        for neighbour in neighbours[node]:
            neighbours[neighbour] |= neighbours[node]
            neighbours[neighbour] -= {node, neighbour}
            depths[neighbour] = max(depths[neighbour], depths[node] + 1)
    rank = {node: k for k, node in enumerate(order)}
    return order, [sorted(rank[node] for node in nodes) for nodes in joined]
