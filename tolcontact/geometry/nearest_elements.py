"""The nearest corners, triangles and edges of two meshes, which determine their shortest distance. Lengths in mm.

The nearest points of two disjoint polyhedra lie at a corner and a facet, or at two convex edges or their ends.
"""

from dataclasses import dataclass

import numpy as np
import trimesh

from tolcontact.errors import GeometryFault
from tolcontact.geometry.body_overlap import SolidBody
from tolcontact.geometry.tolerances import ROUNDING, SAME_DIRECTION
from tolcontact.geometry.triangle_mesh import blocks, edges

SPARES = (0.003, 0.01, 0.03, 0.1, 0.3)  # of the smaller mesh's size: distance of the horizon beyond the shortest distance
MIN_SPARE = 1e-3  # of this size: smallest permitted spare if there are too many elements
MAX_ELEMENTS = (500, 500, 200)  # pairs of a corner and a triangle (both ways), and pairs of edges
MAX_COMPARISONS = 30_000_000  # of triangles with triangles
TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners (pair, 3) of a mesh, and nearby triangles (pair, 3, 3) of the other mesh.

    indices   (pair,) indices of the corners: equal for all triangles near one corner
    slopes    (pair, 3) tangent of half the angle between normals at each concave edge of a triangle, 0 at convex edges
    """

    indices: np.ndarray
    points: np.ndarray
    triangles: np.ndarray
    slopes: np.ndarray


@dataclass(frozen=True, eq=False)
class EdgePairs:
    """Convex edges (pair, end, 3) of two meshes that are near each other.

    senses   (pair,) 1 or -1: sense times the cross product of both edges points from the second mesh to the first one;
             0 where this normal does not fit between the triangles at both edges
    """

    left: np.ndarray
    right: np.ndarray
    senses: np.ndarray


@dataclass(frozen=True, eq=False)
class NearestElements:
    """Elements of two meshes; all others are at least `horizon` [mm] apart. `line` (2, 3) joins the nearest points found.

    corners   of the first mesh over triangles of the second one, and the reverse
    """

    corners: tuple[Corners, Corners]
    edges: EdgePairs
    horizon: float
    line: np.ndarray


class Edged:
    """A mesh with its convex edges and rims.

    ends      (edge, 2) vertex indices
    normals   (edge, 2, 3) of the triangles on both sides, two equal ones on a rim
    slopes    (triangle, 3) as in Corners
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self.vertices, self.faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        self.triangles, self.size, self.solid = self.vertices[self.faces], float(mesh.scale), SolidBody(mesh)
        self.face_normals = normals = np.asarray(mesh.face_normals)
        ends, edge, _ = edges(self.faces)
        owner = np.repeat(np.arange(len(self.faces)), 3)
        by_edge = np.argsort(edge, kind="stable")
        starts = np.searchsorted(edge[by_edge], np.arange(edge.max(initial=-1) + 1))
        lasts = np.append(starts[1:], len(edge)) - 1
        left, right = owner[by_edge[starts]], owner[by_edge[lasts]]
        self.ends = ends[by_edge[starts]]
        self.normals = np.stack([normals[left], normals[right]], axis=1)
        along = self.vertices[self.ends[:, 1]] - self.vertices[self.ends[:, 0]]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), TINY)
        turn = np.arctan2(
            (np.cross(normals[left], normals[right]) * along).sum(axis=1), (normals[left] * normals[right]).sum(axis=1)
        )
        self.slopes = np.tan(np.maximum(-turn, 0) / 2)[edge].reshape(-1, 3)
        is_convex = (turn > SAME_DIRECTION) | (left == right)
        self.edge_of = np.where(is_convex, np.arange(len(is_convex)), -1)[edge].reshape(-1, 3)


def nearest_elements(mesh: trimesh.Trimesh, other_mesh: trimesh.Trimesh, distance: float) -> NearestElements:
    """Return the elements of two meshes that determine their shortest distance, including after small motions.

    distance   [mm] an upper bound of the shortest distance

    Raises GeometryFault if there are too many of them.
    """
    left, right = Edged(mesh), Edged(other_mesh)
    size = min(left.size, right.size)
    for share in SPARES:  # a wider horizon has many more pairs, and is tried only while there are few
        horizon = distance + share * size
        pairs = _near_triangles(left.triangles, right.triangles, horizon)
        corners = _corner_pairs(left, right, pairs), _corner_pairs(right, left, pairs[:, ::-1])
        kinds = [*corners, _edge_pairs(left, right, pairs)]
        nearest_points = [
            _corner_places(left.vertices[kinds[0][:, 0]], right.triangles[kinds[0][:, 1]]),
            _corner_places(right.vertices[kinds[1][:, 0]], left.triangles[kinds[1][:, 1]]),
            _segment_places(left.vertices[left.ends[kinds[2][:, 0]]], right.vertices[right.ends[kinds[2][:, 1]]]),
        ]
        lengths = [np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) for ends in nearest_points]
        if any(np.count_nonzero(values < horizon) > limit for values, limit in zip(lengths, MAX_ELEMENTS, strict=True)):
            break
    for values, limit in zip(lengths, MAX_ELEMENTS, strict=True):
        if len(values) > limit:
            horizon = min(horizon, float(np.partition(values, limit)[limit]))
    if horizon < min(float(values.min(initial=np.inf)) for values in lengths) + MIN_SPARE * size:
        raise GeometryFault(
            f"more than {MAX_ELEMENTS[-1]} corners or edges are within {MIN_SPARE * size:.2g} mm of being nearest; choose "
            "smaller faces, or read the part with a larger chord"
        )
    is_near = [values < horizon for values in lengths]
    left_corners, right_corners, edge_pairs = (kind[mask] for kind, mask in zip(kinds, is_near, strict=True))
    return NearestElements(
        (_corners(left, right, left_corners), _corners(right, left, right_corners)),
        _edges(left, right, edge_pairs, nearest_points[2][is_near[2]]),
        horizon,
        np.concatenate(nearest_points)[np.concatenate(lengths).argmin()],
    )


def _near_triangles(A: np.ndarray, B: np.ndarray, horizon: float) -> np.ndarray:
    """Return the pairs (pair, 2) of triangles A (n, 3, 3) and B (m, 3, 3) whose boxes are within a horizon [mm]."""
    boxes = [(triangles.min(axis=1), triangles.max(axis=1)) for triangles in (A, B)]
    rows = [
        np.flatnonzero(((low <= other_up.max(axis=0) + horizon) & (up >= other_low.min(axis=0) - horizon)).all(axis=1))
        for (low, up), (other_low, other_up) in zip(boxes, boxes[::-1], strict=True)
    ]
    count = len(rows[0]) * len(rows[1])
    if count > MAX_COMPARISONS:
        raise GeometryFault(
            f"its faces have {len(rows[0])} and {len(rows[1])} triangles near each other; choose smaller faces, or read the "
            "parts with a larger chord"
        )
    (lower, upper), (other_lower, other_upper) = ((low[row], up[row]) for (low, up), row in zip(boxes, rows, strict=True))
    pairs = [np.zeros((0, 2), dtype=np.int64)]
    for block in blocks(len(rows[0]), len(rows[1])):
        gaps = np.maximum(other_lower - upper[block, None], lower[block, None] - other_upper)
        nearby = np.argwhere((np.maximum(gaps, 0) ** 2).sum(axis=2) <= horizon**2)
        pairs.append(np.column_stack([rows[0][block][nearby[:, 0]], rows[1][nearby[:, 1]]]))
    return np.concatenate(pairs)


def _corner_pairs(body: Edged, target: Edged, pairs: np.ndarray) -> np.ndarray:
    """Return the corners of a body and the triangles of a target (pair, 2) from pairs of triangles.

    Triangles on the far side of the target are left out for corners outside it.
    """
    rows = np.unique(np.column_stack([body.faces[pairs[:, 0]].ravel(), pairs[:, 1].repeat(3)]), axis=0)
    corners, corner_rows = np.unique(rows[:, 0], return_inverse=True)
    if not len(corners):
        return rows
    offsets = body.vertices[rows[:, 0]] - target.triangles[rows[:, 1], 0]
    is_behind = (offsets * target.face_normals[rows[:, 1]]).sum(axis=1) < -ROUNDING * target.size
    is_inside = target.solid.depth(body.vertices[corners]) > ROUNDING * target.size
    return rows[~is_behind | is_inside[corner_rows]]


def _edge_pairs(left: Edged, right: Edged, pairs: np.ndarray) -> np.ndarray:
    """Return the convex edges (pair, 2) of pairs of triangles."""
    left_edges, right_edges = left.edge_of[pairs[:, 0]], right.edge_of[pairs[:, 1]]
    edge_pairs = np.stack(np.broadcast_arrays(left_edges[:, :, None], right_edges[:, None]), axis=-1).reshape(-1, 2)
    return np.unique(edge_pairs[(edge_pairs >= 0).all(axis=1)], axis=0)


def _corner_places(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return points (pair, 3), each with the nearest point of its triangle (pair, 3, 3): (pair, 2, 3)."""
    if not len(points):
        return np.zeros((0, 2, 3))
    return np.stack([points, trimesh.triangles.closest_point(triangles, points)], axis=1)


def _segment_places(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the nearest points (pair, 2, 3) of segments p and q (pair, end, 3) (Ericson, 5.1.9)."""
    u, v, r = p[:, 1] - p[:, 0], q[:, 1] - q[:, 0], p[:, 0] - q[:, 0]
    uu, vv, uv = ((a * b).sum(axis=1) for a, b in ((u, u), (v, v), (u, v)))
    ur, vr = (u * r).sum(axis=1), (v * r).sum(axis=1)
    s = np.clip((uv * vr - ur * vv) / np.maximum(uu * vv - uv**2, TINY), 0, 1)
    t = np.clip((uv * s + vr) / np.maximum(vv, TINY), 0, 1)
    s = np.clip((uv * t - ur) / np.maximum(uu, TINY), 0, 1)
    return np.stack([p[:, 0] + s[:, None] * u, q[:, 0] + t[:, None] * v], axis=1)


def _corners(body: Edged, target: Edged, pairs: np.ndarray) -> Corners:
    corner, triangle = pairs.T
    return Corners(corner, body.vertices[corner], target.triangles[triangle], target.slopes[triangle])


def _edges(left: Edged, right: Edged, pairs: np.ndarray, nearest_points: np.ndarray) -> EdgePairs:
    left_edges, right_edges = pairs.T
    p, q = left.vertices[left.ends[left_edges]], right.vertices[right.ends[right_edges]]
    n = np.cross(p[:, 1] - p[:, 0], q[:, 1] - q[:, 0])
    side = ((nearest_points[:, 0] - nearest_points[:, 1]) * n).sum(axis=1)
    outward = np.sign(side)[:, None] * n
    fits = _is_between(outward, right.normals[right_edges]) & _is_between(-outward, left.normals[left_edges])
    return EdgePairs(p, q, np.where(fits, np.sign(side), 0.0))


def _is_between(n: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return a mask (pair,) of directions n (pair, 3) at an edge that lie between its normals (pair, 2, 3)."""
    middle = normals.sum(axis=1)
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), TINY)
    cosine = (normals[:, 0] * middle).sum(axis=1)
    widest = np.where(cosine > 1 - SAME_DIRECTION**2, 0.0, cosine)
    return np.asarray((n * middle).sum(axis=1) >= np.linalg.norm(n, axis=1) * widest)
