"""A tree of the boxes around the triangles of a mesh."""

from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.interference.kernel import LEAF

LEVELS = 1 << 10  # cells along each side of the mesh, for sorting triangles


class BoxTree(NamedTuple):
    """A complete binary tree, its nodes in heap order: the children of node i are 2 i + 1 and 2 i + 2.

    triangles   (leaf, LEAF): indices of the triangles in each leaf, -1 where there is none
    boxes       (node, 6) [mm]: lower and upper corner of the box of each node; empty boxes reach from infinity to -infinity
    next        (node,): the node that follows if the children of a node are left out; the number of nodes at the end
    """

    triangles: Int[Array, "l 4"]
    boxes: Float[Array, "n 6"]
    next: Int[Array, " n"]


def box_tree(corners: Float[Array, "t 3 3"]) -> BoxTree:
    """Return the tree of triangles (t, 3, 3) [mm], which are sorted along a Morton curve."""
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    leaves = 1 << max(int(np.ceil(np.log2(max(len(corners), 1) / LEAF))), 0)
    order = np.argsort(_morton(corners.mean(axis=1)), kind="stable")
    places = np.full(leaves * LEAF, -1)
    # Triangles are spread over all leaves, so that all are about equally full.
    leaf = np.arange(len(corners)) * leaves // max(len(corners), 1)
    places[leaf * LEAF + np.arange(len(corners)) - np.searchsorted(leaf, leaf)] = order
    triangles = places.reshape(leaves, LEAF)
    return BoxTree(triangles, boxes_of_nodes(triangles, lower, upper), _successors(2 * leaves - 1))


def boxes_of_nodes(triangles: Int[Array, "l 4"], lower: Float[Array, "t 3"], upper: Float[Array, "t 3"]) -> Float[Array, "n 6"]:
    """Return the boxes of the nodes of a tree with `triangles` in its leaves, whose boxes are `lower` to `upper`."""
    places = triangles.ravel()
    boxes = np.concatenate([np.full((places.size, 3), np.inf), np.full((places.size, 3), -np.inf)], axis=1)
    boxes[places >= 0] = np.concatenate([lower, upper], axis=1)[places[places >= 0]]
    level = _joined(boxes, LEAF)
    levels = [level]
    while len(level) > 1:
        level = _joined(level, 2)
        levels.insert(0, level)
    return np.concatenate(levels)


def _joined(boxes: np.ndarray, count: int) -> np.ndarray:
    """Return the boxes around each `count` boxes in a row."""
    groups = boxes.reshape(-1, count, 6)
    return np.concatenate([groups[..., :3].min(axis=1), groups[..., 3:].max(axis=1)], axis=1)


def _successors(count: int) -> np.ndarray:
    """Return the node that follows each node and its children, in preorder."""
    successors = np.full(count, count)
    for node in range(1, count):
        successors[node] = node + 1 if node % 2 else successors[(node - 1) // 2]
    return successors


def _morton(points: np.ndarray) -> np.ndarray:
    """Return the places of points (point, 3) on a Morton curve."""
    lower, span = points.min(axis=0, initial=np.inf), np.ptp(points, axis=0).max() if len(points) else 1.0
    cells = ((points - lower) / max(float(span), 1e-300) * (LEVELS - 1)).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code
