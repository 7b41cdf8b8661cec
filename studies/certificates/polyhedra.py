"""Measure by linear programmes how far convex polyhedra lie in each other, and by separating axes how far they are apart.

A body is a list of convex pieces. The largest ball in a piece of one body and a piece of another one is a lower bound of the
largest ball in both bodies: enough to contradict a certificate. Nothing here is shared with the simulation.
"""

from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

PARALLEL = 1e-9  # sine of the angle between two directions


class Polyhedron:
    """A convex polyhedron: corners (v, 3) [mm], facets `normals` x <= `offsets` (f, 3), (f,), directions of edges (e, 3)."""

    def __init__(self, points: np.ndarray):
        hull = ConvexHull(points)
        self.corners = points[hull.vertices]
        self.normals = distinct(hull.equations[:, :3])
        self.offsets = (self.normals @ self.corners.T).max(axis=1)
        self.centre = self.corners.mean(axis=0)
        self.radius = float(np.linalg.norm(self.corners - self.centre, axis=1).max())
        self._hull = hull

    @cached_property
    def directions(self) -> np.ndarray:
        """The directions of edges between facets, each once."""
        hull = self._hull
        ends = np.stack([np.delete(hull.simplices, k, axis=1) for k in range(3)], axis=1)  # (triangle, neighbour, 2)
        beside = hull.equations[hull.neighbors, :3]
        is_edge = np.linalg.norm(beside - hull.equations[:, None, :3], axis=2) > PARALLEL
        edges = hull.points[ends[is_edge][:, 0]] - hull.points[ends[is_edge][:, 1]]
        edges = edges / np.linalg.norm(edges, axis=1)[:, None]
        return distinct(edges * np.where(edges @ [1.0, 1e-3, 1e-6] < 0, -1, 1)[:, None])


Body = list[Polyhedron]


def distinct(directions: np.ndarray) -> np.ndarray:
    """Return unit vectors (d, 3), each once."""
    return directions[np.unique(np.round(directions, 9), axis=0, return_index=True)[1]]


def relative(poses: np.ndarray, moving: int, reference: int) -> tuple[np.ndarray, np.ndarray]:
    """Return R (n, 3, 3) and t (n, 3) [mm] of one part in the frame of another one, from poses (n, part, 12)."""
    R, t = poses[..., :9].reshape(*poses.shape[:2], 3, 3), poses[..., 9:]
    back = R[:, reference].transpose(0, 2, 1)
    return back @ R[:, moving], np.einsum("nij,nj->ni", back, t[:, moving] - t[:, reference])


def separation(moving: Polyhedron, reference: Polyhedron, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the signed distance (n,) [mm] of two polyhedra along the best separating axis, negative for a penetration.

    The common normals of two edges count only where no facet separates.
    """
    placed = moving.corners @ R.transpose(0, 2, 1) + t[:, None]
    seen = (reference.corners - t[:, None]) @ R
    distances = np.maximum(
        ((placed @ reference.normals.T).min(axis=1) - reference.offsets).max(axis=1),
        ((seen @ moving.normals.T).min(axis=1) - moving.offsets).max(axis=1),
    )
    close = np.flatnonzero(distances <= 0)
    if close.size:
        turned = moving.directions @ R[close].transpose(0, 2, 1)
        axes = np.cross(turned[:, :, None], reference.directions).reshape(close.size, -1, 3)
        length = np.linalg.norm(axes, axis=2, keepdims=True)
        axes = np.where(length > PARALLEL, axes / np.maximum(length, PARALLEL), reference.normals[0]).transpose(0, 2, 1)
        shadow, other = placed[close] @ axes, reference.corners @ axes
        along, against = shadow.min(axis=1) - other.max(axis=1), other.min(axis=1) - shadow.max(axis=1)
        distances[close] = np.maximum(distances[close], np.maximum(along, against).max(axis=1))
    return distances


def ball(moving: Polyhedron, reference: Polyhedron, R: np.ndarray, t: np.ndarray) -> float:
    """Return the radius [mm] of the largest ball in both polyhedra at one pose; below 0 if they are apart."""
    normals = moving.normals @ R.T
    A = np.concatenate([reference.normals, normals])
    b = np.concatenate([reference.offsets, moving.offsets + normals @ t])
    centre = reference.centre
    bounds = [(None, None)] * 4
    best = linprog([0, 0, 0, -1], A_ub=np.c_[A, np.ones(len(A))], b_ub=b - A @ centre, bounds=bounds, method="highs")
    return float(-best.fun) if best.status == 0 else float("nan")


def close_pieces(
    moving: Body, reference: Body, R: np.ndarray, t: np.ndarray
) -> Iterator[tuple[Polyhedron, Polyhedron, np.ndarray]]:
    """Yield pairs of pieces whose bounding spheres meet, and the indices of these realizations."""
    for piece in moving:
        centres = R @ piece.centre + t
        for other in reference:
            rows = np.flatnonzero(np.linalg.norm(centres - other.centre, axis=1) < piece.radius + other.radius)
            if rows.size:
                yield piece, other, rows


def separations(moving: Body, reference: Body, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the least signed distance (n,) [mm] of any two pieces; infinite if no bounding spheres meet."""
    distances = np.full(len(t), np.inf)
    for piece, other, rows in close_pieces(moving, reference, R, t):
        distances[rows] = np.minimum(distances[rows], separation(piece, other, R[rows], t[rows]))
    return distances


def balls(moving: Body, reference: Body, R: np.ndarray, t: np.ndarray, above: float) -> np.ndarray:
    """Return the radius (n,) [mm] of the largest ball in two pieces, or 0 if it is surely less than `above`."""
    radii = np.zeros(len(t))
    for piece, other, rows in close_pieces(moving, reference, R, t):
        depth = -separation(piece, other, R[rows], t[rows])
        for row in rows[depth > 2 * above]:  # a ball is no wider than the bodies along any axis
            radii[row] = max(radii[row], ball(piece, other, R[row], t[row]))
    return radii


def ball_of_pairs(bodies: list[Body], pairs: Iterable[tuple[int, int]], poses: np.ndarray, above: float) -> np.ndarray:
    """Return the radius (n,) [mm] of the largest ball in two bodies of any pair, at poses (n, part, 12)."""
    radii = [balls(bodies[m], bodies[r], *relative(poses, m, r), above) for m, r in pairs]
    return np.max(radii, axis=0, initial=0.0) if radii else np.zeros(len(poses))


def separation_of_pairs(bodies: list[Body], pairs: Iterable[tuple[int, int]], poses: np.ndarray) -> np.ndarray:
    """Return the least signed distance (n,) [mm] of the bodies of any pair, at poses (n, part, 12)."""
    distances = [np.full(len(poses), np.inf), *(separations(bodies[m], bodies[r], *relative(poses, m, r)) for m, r in pairs)]
    return np.asarray(np.min(distances, axis=0))
