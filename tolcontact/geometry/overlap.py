"""Where two faces are over each other: where their rims cross, and the part of a face that is opposite to the other."""

from typing import NamedTuple

import numpy as np
import trimesh

from tolcontact.geometry.surface import Surface
from tolcontact.geometry.triangle_mesh import edges, overlaps

MAX_EDGES = 2000  # of a rim; above this its corners are so dense that evenly spread points suffice
MIN_ANGLE = np.radians(1.0)  # between edges that cross
INWARD = 1e-5  # of the face's size: distance of points inside the rim
DROP_ITERATIONS = 8  # of points that drop onto a curved face
MAX_PAIRS = 1_000_000  # of triangles that may be opposite to each other, and of pieces at any time
MAX_COMPARED = 4_000_000  # pairs that may be nearer than a pair of the same triangle, for all pairs
BLOCK_TRIANGLES = 64
TIE = 1e-10  # of the face's size: distances that count as 0
MIN_AREA = 1e-14  # of the face's area: smaller triangles are rounding
BEHIND = 0.1  # of the distance in front of a face: how far behind it opposite faces count
FACING = 1e-9  # smallest cosine of the angle between normals of triangles that face each other


def overlap_corners(face: Surface, target: Surface) -> np.ndarray:
    """Return points (corner, 3) [mm] of a face below or above corners of the target's rim, and where both rims cross.

    Corners of the face's own rim are not included.
    """
    edges_p, edges_q = face.rim_ends, target.rim_ends
    if not _are_few(edges_p, edges_q):
        return np.zeros((0, 3))
    n = mean_normal(target)
    row, _, share = _crossings(edges_p, edges_q, n)
    crossings = edges_p[row, 0] + share[:, None] * (edges_p[row, 1] - edges_p[row, 0])
    # Corners of the target's rim, projected along its normal onto this face.
    normal = face.corner_normals.reshape(-1, 3).mean(axis=0)
    corners = target.rim_corners
    if abs(n @ normal) < MIN_ANGLE:
        return crossings
    height = (face.vertices[0] - corners) @ normal / (n @ normal)
    below = corners + height[:, None] * n
    _, _, is_over = face.project(below)
    return np.concatenate([crossings, below[is_over]])


def crossing_edges(face: Surface, target: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Return edges (crossing, end, 3) [mm] of the rim of a face, and the edges of the target's rim that cross them."""
    edges_p, edges_q = face.rim_ends, target.rim_ends
    if not _are_few(edges_p, edges_q):
        return edges_p[:0], edges_q[:0]
    row, column, _ = _crossings(edges_p, edges_q, mean_normal(target))
    return edges_p[row], edges_q[column]


def _are_few(*rims: np.ndarray) -> bool:
    return all(0 < len(edge) <= MAX_EDGES for edge in rims)


def _crossings(edges_p: np.ndarray, edges_q: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which edges p and q (edge, end, 3) cross, seen along n (3,): their indices, and the share of p at the crossing.

    Where p + a r meets q + b s in the plane across n, a = (q - p) x s / (r x s) and b = (q - p) x r / (r x s).
    """
    plane = np.linalg.svd(n[None])[2][1:]
    (start, end), (q_start, q_end) = (edges.swapaxes(0, 1) for edges in (edges_p, edges_q))
    p, r = start @ plane.T, (end - start) @ plane.T
    q, s = q_start @ plane.T, (q_end - q_start) @ plane.T
    cross = r[:, None, 0] * s[None, :, 1] - r[:, None, 1] * s[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        pq = q[None] - p[:, None]
        a = (pq[..., 0] * s[None, :, 1] - pq[..., 1] * s[None, :, 0]) / cross
        b = (pq[..., 0] * r[:, None, 1] - pq[..., 1] * r[:, None, 0]) / cross
    lengths = np.linalg.norm(r, axis=1)[:, None] * np.linalg.norm(s, axis=1)[None]
    row, column = np.nonzero((np.abs(cross) > MIN_ANGLE * lengths) & (a >= 0) & (a <= 1) & (b >= 0) & (b <= 1))
    return row, column, a[row, column]


def mean_normal(face: Surface) -> np.ndarray:
    """Return the mean unit normal (3,) of a face."""
    n = face.corner_normals.reshape(-1, 3).mean(axis=0)
    n /= np.linalg.norm(n)
    return n


def rim_points(face: Surface, target: Surface, step: float, within: float) -> np.ndarray:
    """Return points (point, 3) [mm] of a face over the rim of the flat face `target`, about `step` [mm] apart.

    Only points within `within` [mm] of the rim are returned.
    """
    faces, vertices = np.asarray(target.mesh.faces), np.asarray(target.mesh.vertices)
    ends, edge, triangles = edges(faces)
    outer = np.flatnonzero(triangles[edge] == 1)
    n = mean_normal(target)
    starts = []
    length = np.linalg.norm(vertices[ends[outer, 1]] - vertices[ends[outer, 0]], axis=1)
    step = max(step, float(length.sum()) / MAX_EDGES)
    for number, size in zip(outer, length, strict=True):
        a, b = vertices[ends[number]]
        inward = np.cross(n, b - a) / max(size, 1e-300)
        inward *= np.sign(inward @ (vertices[faces[number // 3]].mean(axis=0) - a))
        share = np.linspace(0, 1, max(int(np.ceil(size / step)), 1) + 1)[:, None]
        starts.append(a + share * (b - a) + INWARD * target.mesh.scale * inward)
    start = np.concatenate(starts)
    points = start
    for _ in range(DROP_ITERATIONS):
        _, projections = face.nearest(points)
        points = start + ((projections - start) @ n)[:, None] * n
    has_arrived = np.linalg.norm(points - projections, axis=1) < 0.1 * INWARD * target.mesh.scale
    is_near = np.linalg.norm(points - start, axis=1) <= within
    return projections[has_arrived & is_near]


def points_on_rim(face: Surface, step: float) -> np.ndarray:
    """Return points (point, 3) [mm] along the rim of a face, at most `step` [mm] apart, including its triangles' corners."""
    starts, ends = face.rim_ends.swapaxes(0, 1)
    pieces = np.maximum(np.ceil(np.linalg.norm(ends - starts, axis=1) / step), 1).astype(int)
    return np.concatenate([np.linspace(a, b, count, endpoint=False) for a, b, count in zip(starts, ends, pieces, strict=True)])


def opposite(face: Surface, target: Surface, within: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the part of a face that is over the target, along its normals, within a distance [mm] in front of it.

    A tenth of this distance behind it counts, too, since bodies may penetrate each other nominally. The target must face it
    there. Over several triangles of the target, the nearest one counts. The result is exact for polyhedra and does not depend
    on their triangles: triangles (triangle, 3, 3) [mm] of the face, and the cosines (triangle,) of their angles to the target.
    It is None if too many triangles overlap to cut them all.
    """
    corners, normals = np.asarray(face.mesh.triangles), np.asarray(face.mesh.face_normals)
    target_corners, target_normals = np.asarray(target.mesh.triangles), np.asarray(target.mesh.face_normals)
    boxes = _swept_boxes(target_corners, within * target_normals[:, None])
    rows, columns = _overlapping(corners, *boxes)
    if len(rows) > MAX_PAIRS:
        return None
    cosines = -(normals[rows] * target_normals[columns]).sum(axis=1)
    rows, columns, cosines = (values[cosines > FACING] for values in (rows, columns, cosines))
    tie = TIE * float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    inward = np.cross(target_normals[:, None], np.roll(target_corners, -1, axis=1) - target_corners)
    inward /= np.maximum(np.linalg.norm(inward, axis=2, keepdims=True), 1e-300)
    lower, upper = (box[columns] for box in boxes)
    pairs = _Pairs(target_corners[columns], target_normals[columns], inward[columns], lower, upper, tie)
    pieces, pair = corners[rows], np.arange(len(rows))
    for k in range(3):
        pieces, pair = _above(pieces, pair, pairs.edge_distances(pair, pieces, k))
    for sign, limit in ((1, BEHIND * within), (-1, within)):
        pieces, pair = _above(pieces, pair, limit + sign * pairs.heights(pair, pieces))
    least = MIN_AREA * face.mesh.area
    large = trimesh.triangles.area(pieces) > least
    nearest = pairs.nearest(pieces[large], pair[large], rows)
    if nearest is None:
        return None
    pieces, pair = nearest
    large = trimesh.triangles.area(pieces) > least
    return pieces[large], cosines[pair[large]]


class _Pairs(NamedTuple):
    """Pairs of a triangle and a target triangle that face each other.

    corners   (pair, 3, 3) [mm] of the target triangles, with their `normals` (pair, 3)
    inward    (pair, edge, 3): unit normals of the edges of the target triangles in their planes
    lower, upper   (pair, 3) [mm]: boxes of the target triangles and what counts in front of and behind them
    tie       [mm]: smaller distances count as 0
    """

    corners: np.ndarray
    normals: np.ndarray
    inward: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    tie: float

    def heights(self, pair: np.ndarray, pieces: np.ndarray) -> np.ndarray:
        """Return the distances (piece, 3) [mm] of the corners of pieces from the target planes of pairs (piece,)."""
        return self._distances(pieces, self.corners[pair, 0], self.normals[pair])

    def edge_distances(self, pair: np.ndarray, pieces: np.ndarray, k: int) -> np.ndarray:
        """Return how far (piece, 3) [mm] the corners of pieces are inside edge k of the target triangles."""
        return self._distances(pieces, self.corners[pair, k], self.inward[pair, k])

    def _distances(self, pieces: np.ndarray, feet: np.ndarray, normals: np.ndarray) -> np.ndarray:
        distances = np.einsum("pck,pk->pc", pieces - feet[:, None], normals)
        return np.where(np.abs(distances) <= self.tie, 0.0, distances)

    def nearest(self, pieces: np.ndarray, pair: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Return pieces (piece, 3, 3) and their pairs (piece,) without the parts where another pair of their row is nearer.

        rows   (pair,) the triangle of each pair
        """
        left = np.unique(pair)  # sorted by rows
        _, first, index, count = np.unique(rows[left], return_index=True, return_inverse=True, return_counts=True)
        if float(count @ count) > MAX_COMPARED:
            return None
        place = np.zeros(len(rows), dtype=int)
        place[left] = np.arange(len(left))
        heights = self.heights(pair, pieces)
        behind = (heights < 0).any(axis=1)
        back = _above(pieces[behind], pair[behind], -heights[behind])
        front = _above(pieces, pair, heights)
        pieces, pair = (np.concatenate(values) for values in zip(front, back, strict=True))
        side = np.repeat([1.0, -1.0], [len(front[1]), len(back[1])])
        for step in range(1, int(count.max(initial=0))):
            group = index[place[pair]]
            others = left[first[group] + (place[pair] - first[group] + step) % count[group]]
            pieces, source = self._uncovered(pieces, pair, side, np.where(step < count[group], others, pair))
            pair, side = pair[source], side[source]
            if len(pieces) > MAX_PAIRS:
                return None
        return pieces, pair

    def _uncovered(
        self, pieces: np.ndarray, pair: np.ndarray, side: np.ndarray, others: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the parts of pieces where the target triangles of `others` (piece,) are not nearer, and their indices."""

        def margins(rows: np.ndarray, parts: np.ndarray, k: int) -> np.ndarray:
            if k < 3:
                return self.edge_distances(others[rows], parts, k)
            own, other = side[rows, None] * self.heights(pair[rows], parts), self.heights(others[rows], parts)
            margin = own - other if k == 3 else own + other
            return np.where(np.abs(margin) <= self.tie, 0.0, margin)

        source = np.arange(len(pieces))
        low, high = pieces.min(axis=1) - self.tie, pieces.max(axis=1) + self.tie
        near = np.flatnonzero(((low <= self.upper[others]) & (high >= self.lower[others])).all(axis=1) & (others != pair))
        for k in range(5):
            near = near[margins(near, pieces[near], k).max(axis=1) > 0]
        is_covered = np.zeros(len(pieces), dtype=bool)
        is_covered[near] = True
        outside, inside, rows = [(pieces[~is_covered], source[~is_covered])], pieces[is_covered], source[is_covered]
        for k in range(5):
            values = margins(rows, inside, k)
            below = (values < 0).any(axis=1)
            outside.append(_above(inside[below], rows[below], -values[below]))
            inside, rows = _above(inside, rows, values)
        parts, sources = (np.concatenate(values) for values in zip(*outside, strict=True))
        return parts, sources


def _swept_boxes(corners: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the boxes (triangle, 3) of triangles (triangle, 3, 3) [mm] moved by their `reach` (triangle, 1, 3), both ways."""
    swept = np.concatenate([corners - reach, corners + reach], axis=1)
    return swept.min(axis=1), swept.max(axis=1)


def _overlapping(corners: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of triangles (triangle, 3, 3) with boxes that overlap those from `lower` to `upper` (target, 3).

    They are two arrays of indices, which stop beyond MAX_PAIRS.
    """
    low, high = corners.min(axis=1), corners.max(axis=1)
    rows, columns, count = [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)], 0
    for first in range(0, len(corners), BLOCK_TRIANGLES):
        block = slice(first, first + BLOCK_TRIANGLES)
        nearby = np.flatnonzero(((lower <= high[block].max(axis=0)) & (upper >= low[block].min(axis=0))).all(axis=1))
        row, column = np.nonzero(overlaps(low[block], high[block], lower[nearby], upper[nearby]))
        rows.append(row + first)
        columns.append(nearby[column])
        count += len(row)
        if count > MAX_PAIRS:
            break
    return np.concatenate(rows), np.concatenate(columns)


def _above(triangles: np.ndarray, labels: np.ndarray, heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces (piece, 3, 3) of triangles (triangle, 3, 3) where the height, linear between corners, is positive.

    The second array is the label (piece,) of each piece's triangle.
    """
    is_above = heights >= 0
    count = is_above.sum(axis=1)
    whole, tips, trunks = (np.flatnonzero(count == k) for k in (3, 1, 2))
    a, ab, ac, _, _ = _cut(triangles[tips], heights[tips], np.argmax(is_above[tips], axis=1))
    _, pq, pr, q, r = _cut(triangles[trunks], heights[trunks], np.argmin(is_above[trunks], axis=1))
    pieces = [triangles[whole], *(np.stack(corners, axis=1) for corners in ((a, ab, ac), (pq, q, r), (pq, r, pr)))]
    return np.concatenate(pieces), labels[np.concatenate([whole, tips, trunks, trunks])]


def _cut(triangles: np.ndarray, heights: np.ndarray, apex: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the apex p of each triangle (the only corner on its side), the cuts of its edges, and its corners q and r."""
    rows = np.arange(len(triangles))
    (p, q, r), (h_p, h_q, h_r) = (
        [values[rows, (apex + k) % 3] for k in range(3)] for values in (triangles, heights[..., None])
    )
    return p, p + h_p / (h_p - h_q) * (q - p), p + h_p / (h_p - h_r) * (r - p), q, r
