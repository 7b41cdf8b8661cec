"""Compiled search for what is nominally near an edge."""

import math

import numpy as np

from tolcontact.compiled import compiled, inlined_uncounted
from tolcontact.geometry.vector_kernel import row
from tolcontact.interference.kernel import LEAF


@inlined_uncounted
def square_distance(boxes, k, low, high):  # type: ignore[no-untyped-def]
    """Return the squared distance of box k from a box."""
    x = max(boxes[k, 0] - high[0], 0.0, low[0] - boxes[k, 3])
    y = max(boxes[k, 1] - high[1], 0.0, low[1] - boxes[k, 4])
    z = max(boxes[k, 2] - high[2], 0.0, low[2] - boxes[k, 5])
    return x * x + y * y + z * z


@compiled
def distances(lower, upper, boxes, successors, result):  # type: ignore[no-untyped-def]
    """Write how far (n,) [mm] boxes from `lower` to `upper` (n, 3) are from the nearest leaf of a BoxTree."""
    inner = successors.size // 2
    for k in range(lower.shape[0]):
        low, high, min_square, node = row(lower, k), row(upper, k), np.inf, 0
        while node < successors.size:
            square = square_distance(boxes, node, low, high)
            if not square < min_square:
                node = successors[node]
            elif node < inner:
                node = 2 * node + 1
            else:
                min_square, node = square, successors[node]
        result[k] = math.sqrt(min_square)


@compiled
def near_facets(lower, upper, tree, around, facet_of, reach, is_written, starts, listed, reaches):  # type: ignore[no-untyped-def]
    """Count, or write, the facets within `reach` [mm] of each box from `lower` to `upper` (n, 3).

    tree        triangles, boxes, next of a BoxTree
    around      (t, 6) [mm]: boxes of the triangles
    facet_of    (t,): the facet of each triangle
    starts      (n + 1,): written if not `is_written`, else read; listed, reaches (m,): the facets, and their distances [mm]
    """
    triangles, boxes, successors = tree
    inner, nearest = successors.size // 2, np.full(facet_of.max() + 1, np.inf)
    candidates = np.empty(nearest.size, dtype=np.int64)
    for k in range(lower.shape[0]):
        low, high, node, count = row(lower, k), row(upper, k), 0, 0
        while node < successors.size:
            square = square_distance(boxes, node, low, high)
            if square > reach * reach:
                node = successors[node]
            elif node < inner:
                node = 2 * node + 1
            else:
                for j in range(LEAF):
                    triangle = triangles[node - inner, j]
                    if triangle >= 0:
                        facet, distance = facet_of[triangle], math.sqrt(square_distance(around, triangle, low, high))
                        if distance <= reach:
                            if nearest[facet] == np.inf:
                                candidates[count], count = facet, count + 1
                            nearest[facet] = min(nearest[facet], distance)
                node = successors[node]
        if is_written:
            order = np.argsort(nearest[candidates[:count]])
            for j in range(count):
                facet = candidates[order[j]]
                listed[starts[k] + j], reaches[starts[k] + j] = facet, nearest[facet]
        else:
            starts[k + 1] = starts[k] + count
        nearest[candidates[:count]] = np.inf
