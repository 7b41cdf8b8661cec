"""Subdivision of triangles down to a maximum edge length. Neighbours keep their common corners."""

import numpy as np

from tolcontact.arrays import Array, Float, Int

MAX_ROUNDS = 30  # each halves the longest edges
SHIFT = 32  # bits of a vertex index in the key of an edge


def subdivided(
    vertices: Float[Array, "v k"], faces: Int[Array, "f 3"], max_edge: float
) -> tuple[Float[Array, "w k"], Int[Array, "g 3"], Int[Array, " g"]]:
    """Return vertices (vertex, k), faces (face, 3) without edges longer than `max_edge`, and the original (face,) of each.

    The first three columns of the vertices are the coordinates that decide which edges are halved. A triangle is divided into
    two, three or four at the midpoints of its long edges. Of the two divisions into three, the one with the shorter diagonal is
    used. Each round only considers the triangles that the previous round divided.

    Raises ValueError if triangles have long edges after MAX_ROUNDS rounds.
    """
    vertices, faces = np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int64)
    origin = np.arange(len(faces))
    done, origins = list[np.ndarray](), list[np.ndarray]()
    for _ in range(MAX_ROUNDS + 1):
        is_long = np.sqrt(sum(_edge_components(column[faces]) ** 2 for column in vertices.T[:3])) > max_edge
        divides = is_long.any(axis=1)
        done.append(faces[~divides])
        origins.append(origin[~divides])
        if not divides.any():
            return vertices, np.concatenate(done), np.concatenate(origins)
        faces, origin, is_long = faces[divides], origin[divides], is_long[divides]
        starts, ends = faces[is_long], faces[:, [1, 2, 0]][is_long]
        keys, number = np.unique(np.maximum(starts, ends) << SHIFT | np.minimum(starts, ends), return_inverse=True)
        midpoints = np.zeros_like(faces)
        midpoints[is_long] = len(vertices) + number
        vertices = np.concatenate([vertices, (vertices[keys & (1 << SHIFT) - 1] + vertices[keys >> SHIFT]) / 2])
        faces, rows = _pieces(vertices, faces, midpoints, is_long)
        origin = origin[rows]
    raise ValueError(f"triangles have edges longer than {max_edge:g} after {MAX_ROUNDS} rounds of halving")


def _edge_components(corners: np.ndarray) -> np.ndarray:
    """Return a component (face, 3) of the edge vectors of triangles, from the same component of their corners (face, 3)."""
    return np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1], corners[:, 0] - corners[:, 2]], axis=1)


def _pieces(
    vertices: np.ndarray, faces: np.ndarray, midpoints: np.ndarray, is_long: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces (piece, 3) of faces (face, 3), and the row (piece,) of each piece's face.

    middles   (face, 3) vertex indices of the midpoints of the edges marked in `is_long` (face, 3)
    """
    count = is_long.sum(axis=1)
    single, double, triple = (np.flatnonzero(count == k) for k in (1, 2, 3))
    # One long edge runs from a to b; two long edges run from a to b and from b to c.
    (a, b, c), (p, _, _) = _turned(faces[single], midpoints[single], is_long[single].argmax(axis=1))
    halves = np.stack([a, p, c, p, b, c], axis=1).reshape(-1, 3)
    (a, b, c), (p, q, _) = _turned(faces[double], midpoints[double], is_long[double].argmin(axis=1) + 1)
    from_a, from_c = (((vertices[i, :3] - vertices[j, :3]) ** 2).sum(axis=1) for i, j in ((a, q), (c, p)))
    is_from_a = from_a <= from_c
    tips = np.stack([p, b, q], axis=1)
    trunks = np.stack([a, p, np.where(is_from_a, q, c)], axis=1), np.stack([np.where(is_from_a, a, p), q, c], axis=1)
    (a, b, c), (p, q, r) = faces[triple].T, midpoints[triple].T
    quarters = np.stack([a, p, r, p, b, q, r, q, c, p, q, r], axis=1).reshape(-1, 3)
    rows = np.concatenate([single.repeat(2), np.tile(double, 3), triple.repeat(4)])
    return np.concatenate([halves, tips, *trunks, quarters]), rows


def _turned(faces: np.ndarray, midpoints: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (3, face) of faces (face, 3) and the midpoints (3, face) of their edges, from corner `first` on."""
    order = (first[:, None] + np.arange(3)) % 3
    return np.take_along_axis(faces, order, axis=1).T, np.take_along_axis(midpoints, order, axis=1).T
