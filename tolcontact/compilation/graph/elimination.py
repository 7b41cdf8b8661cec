"""Orders in which the nodes of a graph are eliminated: bodies, or the joints between them."""

from collections.abc import Callable, Sequence

Key = Callable[[int, Sequence[int], Sequence[set[int]]], tuple[int, ...]]


def least_degree(node: int, depths: Sequence[int], neighbours: Sequence[set[int]]) -> tuple[int, ...]:
    """Return the key of the order of minimum degree, whose factors have few entries; a chain is eliminated from both ends."""
    return len(neighbours[node]), depths[node], node


def least_depth(node: int, depths: Sequence[int], neighbours: Sequence[set[int]]) -> tuple[int, ...]:
    """Return the key of an order whose tree is flat: every other node of a chain, then every other one of those that remain."""
    return depths[node], len(neighbours[node]), node


def elimination(graph: Sequence[set[int]], key: Key) -> tuple[list[int], list[list[int]]]:
    """Return the order of the nodes, and by rank the ranks of later nodes that elimination joins to the node.

    graph   the neighbours of each node

    Of all nodes that remain, the one with the smallest key comes next; its neighbours become neighbours of one another.
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
