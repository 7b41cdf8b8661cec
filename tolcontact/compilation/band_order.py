"""The order of variables and rows in which the optimality conditions of a QP are a narrow band: body after body."""

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Int
from tolcontact.mechanics.correction import FREEDOMS


def band_order(h: ca.Sparsity, a: ca.Sparsity, *, slacks: int) -> Int[Array, " unknown"]:
    """Return the variables of the movers, and the rows after them, mover by mover; a row follows the last of its movers.

    Movers are in the order of Cuthill and McKee.
    """
    size = h.size1() - slacks
    movers_of_rows: list[set[int]] = [set() for _ in range(a.size1())]
    for row, column in zip(*a.get_triplet(), strict=True):
        if column < size:
            movers_of_rows[row].add(column // FREEDOMS)
    neighbours: list[set[int]] = [set() for _ in range(size // FREEDOMS)]
    coupled = ({row // FREEDOMS, column // FREEDOMS} for row, column in zip(*h.get_triplet(), strict=True) if row < size)
    for movers in (*movers_of_rows, *coupled):
        for mover in movers:
            neighbours[mover] |= movers - {mover}
    rank = {mover: k for k, mover in enumerate(_cuthill_mckee(neighbours))}
    variables = [(rank[k // FREEDOMS], 0, k) for k in range(size)]
    rows = [(max((rank[mover] for mover in movers), default=-1), 1, size + k) for k, movers in enumerate(movers_of_rows)]
    return np.array([unknown for *_, unknown in sorted(variables + rows)], dtype=np.int64)


def _cuthill_mckee(neighbours: list[set[int]]) -> list[int]:
    """Return the nodes of a graph, each island level by level, from the last node of its levels about any of its nodes."""
    order: list[int] = []
    for node in range(len(neighbours)):
        if node not in order:
            order += _levels(neighbours, _levels(neighbours, node)[-1])
    return order


def _levels(neighbours: list[set[int]], start: int) -> list[int]:
    """Return the nodes that are connected with `start`, the nearest ones first, of these those with few neighbours."""
    order, reached = [start], {start}
    for node in order:
        following = sorted(neighbours[node] - reached, key=lambda other: (len(neighbours[other]), other))
        order += following
        reached.update(following)
    return order
