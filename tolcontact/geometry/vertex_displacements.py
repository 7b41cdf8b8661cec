"""Displacements that keep vertices on their adjacent planes."""

import numpy as np

from tolcontact.arrays import Array, Float, Int

TINY = 1e-300
SAME_PLANE = 1e-5  # rad: planes at a smaller angle are one


def displacements(
    vertex: Int[Array, " p"],
    normals: Float[Array, "p 3"],
    heights: Float[Array, "p k"],
    count: int,
    min_singular: float,
    motions: Float[Array, "p 3 k"] | None = None,
) -> Float[Array, "count 3 k"]:
    """Return displacements u of `count` vertices onto their adjacent planes: N u = h, by least squares, with the shortest u.

    Each of the k columns is a separate case. In a direction whose singular value is below `min_singular`, as a share of the
    largest singular value, or of 1 if that is larger, u is the mean of the planes' `motions`, weighted by how much each plane
    restricts that direction; without `motions`, or if all planes are one, it is 0.

    vertex    (p,): the vertex of each plane
    normals   (p, 3): of unit length, or shorter
    heights   (p, k) of the planes above the vertices
    motions   (p, 3, k) of the points of the planes at the vertices
    """
    squares, sides = np.zeros((count, 3, 3)), np.zeros((count, 3, heights.shape[1]))
    np.add.at(squares, vertex, normals[:, :, None] * normals[:, None])
    np.add.at(sides, vertex, normals[:, :, None] * heights[:, None])
    values, vectors = np.linalg.eigh(squares)
    is_determined = values > min_singular**2 * values.max(axis=1, initial=1.0, keepdims=True)
    inverse = np.where(values > SAME_PLANE**2, 1 / np.maximum(values, TINY), 0.0)[..., None]
    along = np.where(is_determined[..., None], vectors.swapaxes(1, 2) @ sides, 0.0)
    if motions is not None:
        axes = vectors[vertex].swapaxes(1, 2)
        means = np.zeros_like(along)
        np.add.at(means, vertex, (axes @ normals[..., None]) ** 2 * (axes @ motions))
        along = np.where(is_determined[..., None], along, means)
    return np.asarray(vectors @ (inverse * along))


def capped(vectors: Float[Array, "n 3"], length: float) -> Float[Array, "n 3"]:
    """Return vectors no longer than `length`."""
    lengths = np.linalg.norm(vectors, axis=1)
    return vectors * np.minimum(1.0, length / np.maximum(lengths, TINY))[:, None]
