"""The layout of a QP on the graph of bodies: which bodies a row touches, and in which order joints are eliminated.

A joint is the set of rows that share a slack (those of a contact pair), or of equations that touch the same bodies.
"""

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from tolcontact.compilation.graph.elimination import elimination, least_degree, least_depth
from tolcontact.mechanics.correction import FREEDOMS


class Layout(NamedTuple):
    """Constant arrays of all QPs of a group. Bodies, joints and rows are numbered in the order of their elimination.

    body_order      (body,) number of each body in the QP
    row_order       (row,) number of each row in the QP, the rows of a joint one after the other
    block_count     (row,) number of bodies that the row touches
    blocks          (row, block) these bodies, in ascending order
    entries         (nonzero of a) place of each nonzero in the buffer of the rows: slopes (row, block, 6), then openings (row,)
    joint           (row,) joint of each row
    row_starts      (joint + 1,) first row of each joint
    positions       (joint + 1,) first position of each joint in the Gram matrix of the rows that carry
    slack           (joint,) slack of the joint, or -1
    prior_starts    (joint + 1,) first entry of each joint in `prior`
    prior           earlier joints with which a joint has entries in the factor of the Gram matrix
    adjacent        whether these joints share a body, so that the Gram matrix has entries, too
    near_starts     (joint + 1,) first entry of each joint in `near`
    near            joints that share a body with a joint
    hessian_entries (nonzero of h) place of each nonzero in the buffer of blocks (block, 6, 6), or -1
    body_starts     (body + 1,) first block of each body's row in the factor of H
    columns         (block,) body of each block's column; the last block of a row is on the diagonal
    """

    body_order: np.ndarray
    row_order: np.ndarray
    block_count: np.ndarray
    blocks: np.ndarray
    entries: np.ndarray
    joint: np.ndarray
    row_starts: np.ndarray
    positions: np.ndarray
    slack: np.ndarray
    prior_starts: np.ndarray
    prior: np.ndarray
    adjacent: np.ndarray
    near_starts: np.ndarray
    near: np.ndarray
    hessian_entries: np.ndarray
    body_starts: np.ndarray
    columns: np.ndarray


def layout(h: ca.Sparsity, a: ca.Sparsity, *, slacks: int, equations: int, coupled: bool) -> Layout:
    """Return the layout of QPs with these sparsities; if `coupled`, of QPs whose H has blocks beside its diagonal.

    Such a H = C C' is taken to the rows: they become C^-1 a, and touch the bodies that follow theirs in the order as well.
    """
    bodies, count = (h.size1() - slacks) // FREEDOMS, a.size1()
    rows, columns = (np.array(indices, dtype=np.int64) for indices in a.get_triplet())
    of_body = columns < bodies * FREEDOMS
    touched: list[set[int]] = [set() for _ in range(count)]
    for row, column in zip(rows[of_body].tolist(), columns[of_body].tolist(), strict=True):
        touched[row].add(column // FREEDOMS)
    slack_of_row = np.full(count, -1)
    slack_of_row[rows[~of_body]] = columns[~of_body] - bodies * FREEDOMS
    graph = _body_graph(h, bodies) if coupled else [set() for _ in range(bodies)]
    body_order, later = elimination(graph, least_depth)
    if coupled:
        touched = [_with_later(body_order, later, nodes) for nodes in touched]
    joints, equation_joints = _joints(touched, slack_of_row.tolist(), count - equations)
    joint_bodies = [set().union(*(touched[row] for row in members)) for members in joints]
    near = [{k for k, nodes in enumerate(joint_bodies) if k != j and nodes & joint_bodies[j]} for j in range(len(joints))]
    # Equations come first, so that no equation is dropped because it depends on rows that may leave.
    order, joined = elimination(near, lambda j, depths, graph: (j >= equation_joints, *least_degree(j, depths, graph)))
    rank = np.argsort(order)
    prior = [sorted(k for k, nodes in enumerate(joined) if j in nodes) for j in range(len(order))]
    members = [joints[j] for j in order]
    row_order = np.array([row for rows_of_joint in members for row in rows_of_joint], dtype=np.int64)
    body_rank = np.argsort(body_order)
    blocks = [sorted(int(body_rank[body]) for body in touched[row]) for row in row_order]
    width = max([1, *map(len, blocks)])
    sizes = [len(joints[j]) if j < equation_joints else min(len(joints[j]), FREEDOMS * len(joint_bodies[j]) + 2) for j in order]
    adjacent = [order[k] in near[order[j]] for j, nodes in enumerate(prior) for k in nodes]
    body_starts, block_columns, hessian_entries = _hessian_blocks(h, bodies, later, body_rank)
    return Layout(
        body_order=np.array(body_order, dtype=np.int64),
        row_order=row_order,
        block_count=np.array([len(nodes) for nodes in blocks], dtype=np.int64),
        blocks=np.array([nodes + [0] * (width - len(nodes)) for nodes in blocks], dtype=np.int64).reshape(count, width),
        entries=_entries(rows, columns, np.argsort(row_order), body_rank, blocks, width),
        joint=np.repeat(np.arange(len(order)), [len(rows_of_joint) for rows_of_joint in members]),
        row_starts=_starts(members),
        positions=np.cumsum([0, *sizes]),
        slack=np.array([slack_of_row[rows_of_joint[0]] for rows_of_joint in members], dtype=np.int64),
        prior_starts=_starts(prior),
        prior=np.array([k for nodes in prior for k in nodes], dtype=np.int64),
        adjacent=np.array(adjacent, dtype=np.bool_),
        near_starts=_starts([near[j] for j in order]),
        near=np.array([rank[k] for j in order for k in sorted(near[j])], dtype=np.int64),
        hessian_entries=hessian_entries,
        body_starts=body_starts,
        columns=block_columns,
    )


def _starts(lists: Sequence[Sequence[int] | set[int]]) -> np.ndarray:
    return np.cumsum([0, *map(len, lists)])


def _body_graph(h: ca.Sparsity, bodies: int) -> list[set[int]]:
    """Return the bodies with which H couples each body."""
    graph: list[set[int]] = [set() for _ in range(bodies)]
    for row, column in zip(*h.get_triplet(), strict=True):
        i, j = row // FREEDOMS, column // FREEDOMS
        if i != j and max(i, j) < bodies:
            graph[i].add(j)
            graph[j].add(i)
    return graph


def _with_later(order: Sequence[int], later: Sequence[Sequence[int]], bodies: set[int]) -> set[int]:
    """Return the bodies, and those that follow them in the factor of H."""
    ranks = {order.index(body) for body in bodies}
    for rank in range(len(order)):
        if rank in ranks:
            ranks.update(later[rank])
    return {order[rank] for rank in ranks}


def _joints(touched: Sequence[set[int]], slacks: Sequence[int], inequalities: int) -> tuple[list[list[int]], int]:
    """Return the rows of each joint, those of equations in front, and their number."""
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
    """Return the place of each nonzero of a in the buffer of the rows."""
    openings = len(blocks) * width * FREEDOMS
    places = np.zeros(len(rows), dtype=np.int64)
    for k, (row, column) in enumerate(zip(row_rank[rows].tolist(), columns.tolist(), strict=True)):
        body, freedom = divmod(column, FREEDOMS)
        if body >= len(body_rank):
            places[k] = openings + row
        else:
            places[k] = (row * width + blocks[row].index(int(body_rank[body]))) * FREEDOMS + freedom
    return places


def _hessian_blocks(
    h: ca.Sparsity, bodies: int, later: Sequence[Sequence[int]], body_rank: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return `body_starts`, `columns` and `hessian_entries` of a Layout; H is read below its diagonal."""
    columns = [[*(k for k, nodes in enumerate(later) if body in nodes), body] for body in range(bodies)]
    starts = _starts(columns)
    places = np.full(h.nnz(), -1, dtype=np.int64)
    for k, (row, column) in enumerate(zip(*h.get_triplet(), strict=True)):
        if max(row, column) < bodies * FREEDOMS:
            i, j = int(body_rank[row // FREEDOMS]), int(body_rank[column // FREEDOMS])
            if j in columns[i]:
                block = starts[i] + columns[i].index(j)
                places[k] = (block * FREEDOMS + row % FREEDOMS) * FREEDOMS + column % FREEDOMS
    return starts, np.array([k for nodes in columns for k in nodes], dtype=np.int64), places
