"""Points where the rim of one face lies over or under the other face, where the faces touch first at any tilt."""

import numpy as np

from tolcontact.geometry.surface import Surface
from tolcontact.geometry.triangle_mesh import edges

MAX_EDGES = 2000  # of a rim; above this its corners are so dense that evenly spread points suffice
MIN_ANGLE = np.radians(1.0)  # between edges that cross
INWARD = 1e-5  # of the face's size: distance of points inside the rim
DROP_ITERATIONS = 8  # of points that drop onto a curved face


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
