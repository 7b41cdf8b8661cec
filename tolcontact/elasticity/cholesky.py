"""The sparse Cholesky factor of a free body's stiffness, by ngsolve."""

from collections.abc import Callable
from importlib import import_module

import numpy as np
from scipy import linalg, sparse

from tolcontact.arrays import Array, Float


def balanced_solver(
    stiffness: sparse.csr_array, motions: Float[Array, "force 6"], nodes: Float[Array, "node 3"]
) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function that solves K u = f for balanced forces (3 node, load) [N].

    Six freedoms of three distant nodes are held, so that no rigid motion is left. Balanced forces leave them without reactions:
    any other six give the same u up to a rigid motion.
    """
    ngsolve = import_module("ngsolve")
    held = _held_freedoms(motions, nodes)
    free = np.setdiff1d(np.arange(stiffness.shape[0]), held)
    block = sparse.tril(stiffness[free][:, free]).tocoo()
    matrix = ngsolve.la.SparseMatrixd.CreateFromCOO(
        block.row.astype(np.int32), block.col.astype(np.int32), block.data, *block.shape
    )
    inverse = matrix.Inverse(inverse="sparsecholesky")

    def solve(forces: np.ndarray) -> np.ndarray:
        right, left = matrix.CreateColVector(), matrix.CreateColVector()
        displacements = np.zeros(forces.shape)
        for k in range(forces.shape[1]):
            right.FV().NumPy()[:] = forces[free, k]
            left.data = inverse * right
            displacements[free, k] = left.FV().NumPy()
        return displacements

    return solve


def _held_freedoms(motions: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return six freedoms (6,) of three nodes far apart that hold a body best."""
    first = int(np.argmax(np.linalg.norm(nodes - nodes.mean(axis=0), axis=1)))
    second = int(np.argmax(np.linalg.norm(nodes - nodes[first], axis=1)))
    line = nodes[second] - nodes[first]
    third = int(np.argmax(np.linalg.norm(np.cross(nodes - nodes[first], line), axis=1)))
    candidates = (3 * np.array([[first], [second], [third]]) + np.arange(3)).ravel()
    _, _, order = linalg.qr(motions[candidates].T, pivoting=True)
    return candidates[order[:6]]
