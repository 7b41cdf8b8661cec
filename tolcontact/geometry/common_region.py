"""The region of a flat face over another flat face: its triangles, cut along the edges of the other face's triangles."""

import numpy as np
import trimesh

from tolcontact.geometry.overlap import mean_normal
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.triangle_mesh import overlaps

MAX_PAIRS = 1_000_000  # of triangles that may overlap
BLOCK_TRIANGLES = 64
TIE = 1e-10  # of the face's size: largest distance from an edge of a corner that counts as on it
MIN_AREA = 1e-14  # of the face's area: smaller triangles are rounding


def common_region(face: Surface, target: Surface) -> np.ndarray | None:
    """Return triangles (triangle, 3, 3) [mm] that cover the region of a flat face over a flat target.

    Over means along the normal of the target. The result is None if too many triangles overlap to cut them all.
    """
    corners, target_corners = np.asarray(face.mesh.triangles), np.asarray(target.mesh.triangles)
    n = mean_normal(target)
    rows, columns = _overlapping(*(points - (points @ n)[..., None] * n for points in (corners, target_corners)))
    if len(rows) > MAX_PAIRS:
        return None
    pieces, edges = corners[rows], target_corners[columns]
    tolerance = TIE * float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    for k in range(3):
        start, along = edges[:, k], edges[:, (k + 1) % 3] - edges[:, k]
        inward = np.cross(n, along)
        inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-300)
        heights = ((pieces - start[:, None]) * inward[:, None]).sum(axis=2)
        pieces, sources = _above(pieces, np.where(np.abs(heights) <= tolerance, 0.0, heights))
        edges = edges[sources]
    return np.asarray(pieces[trimesh.triangles.area(pieces) > MIN_AREA * face.mesh.area])


def _overlapping(corners: np.ndarray, target_corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of the pairs of triangles (triangle, 3, 3) with overlapping boxes; stops beyond MAX_PAIRS of them."""
    lower, upper = target_corners.min(axis=1), target_corners.max(axis=1)
    rows, columns, count = [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)], 0
    for first in range(0, len(corners), BLOCK_TRIANGLES):
        block = corners[first : first + BLOCK_TRIANGLES]
        nearby = np.flatnonzero(((lower <= block.max(axis=(0, 1))) & (upper >= block.min(axis=(0, 1)))).all(axis=1))
        row, column = np.nonzero(overlaps(block.min(axis=1), block.max(axis=1), lower[nearby], upper[nearby]))
        rows.append(row + first)
        columns.append(nearby[column])
        count += len(row)
        if count > MAX_PAIRS:
            break
    return np.concatenate(rows), np.concatenate(columns)


def _above(triangles: np.ndarray, heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces (piece, 3, 3) of triangles (triangle, 3, 3) where the height, linear between corners, is positive.

    The second array is the index (piece,) of each piece's triangle.
    """
    is_above = heights >= 0
    count = is_above.sum(axis=1)
    whole, tips, trunks = (np.flatnonzero(count == k) for k in (3, 1, 2))
    a, ab, ac, _, _ = _cut(triangles[tips], heights[tips], np.argmax(is_above[tips], axis=1))
    _, pq, pr, q, r = _cut(triangles[trunks], heights[trunks], np.argmin(is_above[trunks], axis=1))
    pieces = [triangles[whole], *(np.stack(corners, axis=1) for corners in ((a, ab, ac), (pq, q, r), (pq, r, pr)))]
    return np.concatenate(pieces), np.concatenate([whole, tips, trunks, trunks])


def _cut(triangles: np.ndarray, heights: np.ndarray, apex: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the apex p of each triangle (the only corner on its side), the cuts of its edges, and its corners q and r."""
    rows = np.arange(len(triangles))
    (p, q, r), (h_p, h_q, h_r) = (
        [values[rows, (apex + k) % 3] for k in range(3)] for values in (triangles, heights[..., None])
    )
    return p, p + h_p / (h_p - h_q) * (q - p), p + h_p / (h_p - h_r) * (r - p), q, r
