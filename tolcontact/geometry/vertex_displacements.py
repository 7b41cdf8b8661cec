"""Displacements that keep vertices on their adjacent planes."""

import numpy as np

from tolcontact.arrays import Array, Float, Int

TINY = 1e-300


def displacements(
    vertex: Int[Array, " p"], normals: Float[Array, "p 3"], heights: Float[Array, "p k"], count: int, min_singular: float
) -> Float[Array, "count 3 k"]:
    """Return displacements u of `count` vertices onto their adjacent planes: N u = h, by least squares, with the shortest u.

    Each of the k columns is a separate case. There is no displacement in directions whose singular value is below
    `min_singular`, as a share of the largest singular value, or of 1 if that is larger.

    vertex    (p,): the vertex of each plane
    normals   (p, 3): of unit length, or shorter
    heights   (p, k) of the planes above the vertices
    """
    squares, sides = np.zeros((count, 3, 3)), np.zeros((count, 3, heights.shape[1]))
    np.add.at(squares, vertex, normals[:, :, None] * normals[:, None])
    np.add.at(sides, vertex, normals[:, :, None] * heights[:, None])
    values, vectors = np.linalg.eigh(squares)
    is_determined = values > min_singular**2 * values.max(axis=1, initial=1.0, keepdims=True)
    inverse = np.where(is_determined, 1 / np.maximum(values, TINY), 0.0)
    return np.asarray(vectors @ (inverse[..., None] * (vectors.swapaxes(1, 2) @ sides)))


def capped(vectors: Float[Array, "n 3"], length: float) -> Float[Array, "n 3"]:
    """Return vectors no longer than `length`."""
    lengths = np.linalg.norm(vectors, axis=1)
    return vectors * np.minimum(1.0, length / np.maximum(lengths, TINY))[:, None]
