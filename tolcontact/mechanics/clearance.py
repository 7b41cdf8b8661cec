"""The clearance of two faces at any pose.

The clearance of two plane faces is the minimum height within their overlap region at that pose. Heights are linear over this
region, so the minimum is at one of its corners. A corner of the region is a corner of one outline inside the other, or a
crossing of edges of both, as seen along the normal of the reference face.

The clearance of two triangulated faces is the minimum distance of corners, facets and edges. The clearance of a corner is its
signed height over the nearest facet that it projects onto, negative inside the material. The clearance of two edges that may
touch first is the distance of their lines along the common normal, negative where the edges have passed each other. The
clearance of all other edges is their shortest distance. Elements outside the horizon are not evaluated: they are further apart
than the horizon, less the motion of the moving face relative to the reference face. The clearance is never larger than that.
"""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.discretization.measured_geometry import MeshClearance, PlaneClearance
from tolcontact.geometry.nearest_elements import Corners, EdgePairs
from tolcontact.mechanics.pose import Pose

NO_HEIGHT = 1e300  # height of a corner that the overlap region does not have, or that projects onto no facet
MARGIN = 1e-9  # of an edge or a facet: crossings at its end, and corners up to this distance outside it, count
MIN_CROSS = 1e-12  # of the product of the lengths of two edges: nearly parallel ones do not cross
MIN_SQUARE = 1e-300  # of a length: keeps quotients finite where a segment has no length


def plane_clearance(clearance: PlaneClearance, X_21: Pose, otherwise: ca.SX) -> ca.SX:
    """Return the clearance [mm] at the pose of the moving face relative to the reference; `otherwise` without overlap."""
    moving, reference = clearance.outlines
    o, n = clearance.planes[1].origin, clearance.planes[1].axis
    across = np.linalg.svd(n[None])[2][1:]
    moved = [X_21.apply(ca.DM(vertex)) - ca.DM(o) for vertex in moving.vertices]
    p, heights = [ca.DM(across) @ vertex for vertex in moved], [ca.dot(ca.DM(n), vertex) for vertex in moved]
    q = [ca.SX(ca.DM(vertex)) for vertex in (reference.vertices - o) @ across.T]
    edges_p, edges_q = ([(ends[a], ends[b]) for a, b in outline.edges] for ends, outline in ((p, moving), (q, reference)))
    plane, normal = X_21.apply(ca.DM(clearance.planes[0].origin)), X_21.R @ ca.DM(clearance.planes[0].axis)
    candidates = [ca.if_else(_is_inside(point, edges_q), height, NO_HEIGHT) for point, height in zip(p, heights, strict=True)]
    candidates += [
        ca.if_else(_is_inside(point, edges_p), ca.dot(normal, ca.DM(vertex) - plane), NO_HEIGHT)
        for point, vertex in zip(q, reference.vertices, strict=True)
    ]
    ends = [(heights[a], heights[b]) for a, b in moving.edges]
    candidates += [
        _crossing(edge_p, edge_q, *edge_heights)
        for edge_p, edge_heights in zip(edges_p, ends, strict=True)
        for edge_q in edges_q
    ]
    clearance_of_region = minimum(candidates)
    return ca.if_else(clearance_of_region < NO_HEIGHT, clearance_of_region, otherwise)


def _is_inside(point: ca.SX, edges: Sequence[tuple[ca.SX, ca.SX]]) -> ca.SX:
    """Return whether a point (2, 1) is inside an outline: a ray from it crosses an odd number of edges."""
    parity = ca.SX(1)
    for start, end in edges:
        spans = (start[1] > point[1]) != (end[1] > point[1])
        crossing = start[0] + (point[1] - start[1]) * (end[0] - start[0]) / _nonzero(end[1] - start[1])
        parity *= ca.if_else(ca.logic_and(spans, point[0] < crossing), -1, 1)
    return parity < 0


def _crossing(p: tuple[ca.SX, ca.SX], q: tuple[ca.SX, ca.SX], start: ca.SX, end: ca.SX) -> ca.SX:
    """Return the height where edge p crosses edge q, from the heights of its ends; NO_HEIGHT if they do not cross."""
    r, s, gap = p[1] - p[0], q[1] - q[0], q[0] - p[0]
    cross = _cross(r, s)
    share_p, share_q = _cross(gap, s) / _nonzero(cross), _cross(gap, r) / _nonzero(cross)
    is_crossing = cross**2 > MIN_CROSS**2 * ca.sumsqr(r) * ca.sumsqr(s)
    for share in (share_p, share_q):
        is_crossing = ca.logic_and(is_crossing, ca.fabs(share - 0.5) <= 0.5 + MARGIN)
    return ca.if_else(is_crossing, start + share_p * (end - start), NO_HEIGHT)


def _cross(a: ca.SX, b: ca.SX) -> ca.SX:
    return a[0] * b[1] - a[1] * b[0]


def _nonzero(value: ca.SX) -> ca.SX:
    return ca.if_else(value == 0, 1, value)


def mesh_clearance(clearance: MeshClearance, X_21: Pose) -> ca.SX:
    """Return the clearance [mm] at the pose of the moving face relative to the reference one."""
    elements = clearance.elements
    X_12 = Pose(X_21.R.T, -X_21.R.T @ X_21.t)
    values = [*_heights(elements.corners[0], X_21), *_heights(elements.corners[1], X_12)]
    values += _edge_distances(elements.edges, X_21)
    motion = ca.vertcat(*(ca.norm_2(X_21.apply(ca.DM(corner)) - ca.DM(corner)) for corner in clearance.box))
    return minimum([*values, elements.horizon - ca.mmax(motion)])


def _heights(corners: Corners, X: Pose) -> list[ca.SX]:
    """Return the height [mm] of each corner at pose X over the nearest facet that it projects onto, or NO_HEIGHT."""
    heights = []
    for corner in np.unique(corners.indices):
        rows = np.flatnonzero(corners.indices == corner)
        p, nearest = X.apply(ca.DM(corners.points[rows[0]])), ca.SX(NO_HEIGHT)
        for row in rows:
            height = _height(p, corners.triangles[row], corners.slopes[row])
            nearest = ca.if_else(ca.fabs(height) < ca.fabs(nearest), height, nearest)
        heights.append(nearest)
    return heights


def _height(p: ca.SX, triangle: np.ndarray, slopes: np.ndarray) -> ca.SX:
    """Return the height of a point p (3, 1) over a triangle (3, 3); NO_HEIGHT if the point does not project onto it.

    Below two facets that meet in a concave edge, their bisecting plane separates the regions of the two.
    """
    along = np.roll(triangle, -1, axis=0) - triangle
    n = np.cross(along[0], along[1])
    n /= np.linalg.norm(n)
    inward = np.cross(n, along)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    height = ca.dot(ca.DM(n), p) - float(n @ triangle[0])
    depth, margin = ca.fmax(-height, 0), MARGIN * float(np.linalg.norm(along, axis=1).max())
    is_over = ca.SX(1)
    for corner, direction, slope in zip(triangle, inward, slopes, strict=True):
        inset = ca.dot(ca.DM(direction), p) - float(direction @ corner)
        is_over = ca.logic_and(is_over, inset + (float(slope) * depth if slope else 0) >= -margin)
    return ca.if_else(is_over, height, NO_HEIGHT)


def _edge_distances(pairs: EdgePairs, X: Pose) -> list[ca.SX]:
    """Return the distance [mm] of each edge at pose X from the other edge of its pair."""
    distances = []
    for left, right, sense in zip(pairs.left, pairs.right, pairs.senses, strict=True):
        p, q = [X.apply(ca.DM(end)) for end in left], [ca.SX(ca.DM(end)) for end in right]
        distance = segment_distance(p, q)
        if sense:
            u, v, r = p[1] - p[0], q[1] - q[0], q[0] - p[0]
            n = ca.cross(u, v)
            square = ca.fmax(ca.sumsqr(n), MIN_SQUARE)
            shares = ca.dot(ca.cross(r, v), n) / square, ca.dot(ca.cross(r, u), n) / square
            is_inner = ca.logic_and(*(ca.logic_and(share > 0, share < 1) for share in shares))
            distance = ca.if_else(is_inner, -float(sense) * ca.dot(n, r) / ca.sqrt(square), distance)
        distances.append(distance)
    return distances


def minimum(values: Any) -> ca.SX:
    """Return the minimum of several expressions."""
    return ca.mmin(ca.vertcat(*values))


def segment_distance(moving: Sequence[ca.SX], reference: Sequence[ca.SX]) -> ca.SX:
    """Return the shortest distance [mm] of two segments between ends (3, 1), which may be parallel.

    It is the minimum of five distances: from each end to the other segment, and between the closest points of the two lines if
    both lie between the ends (Ericson, Real-Time Collision Detection, 5.1.9). Each is the distance of a point on one segment
    from a point on the other. So none is too short, even where the lines are almost parallel and their closest points
    uncertain.
    """
    p, q, r = moving[1] - moving[0], reference[1] - reference[0], reference[0] - moving[0]
    pp, qq, pq = ca.dot(p, p), ca.dot(q, q), ca.dot(p, q)

    def squared(s: ca.SX | float, t: ca.SX | float) -> ca.SX:
        return ca.sumsqr(r + t * q - s * p)

    def on_moving(t: ca.SX | float) -> ca.SX:
        return clipped(ca.dot(p, r + t * q) / ca.fmax(pp, MIN_SQUARE))

    def on_reference(s: ca.SX | float) -> ca.SX:
        return clipped(ca.dot(q, s * p - r) / ca.fmax(qq, MIN_SQUARE))

    inner = clipped((ca.dot(p, r) * qq - ca.dot(q, r) * pq) / ca.fmax(pp * qq - pq**2, MIN_SQUARE))
    squares = [squared(s, on_reference(s)) for s in (0.0, 1.0, inner)] + [squared(on_moving(t), t) for t in (0.0, 1.0)]
    return ca.sqrt(minimum(squares))


def clipped(share: ca.SX) -> ca.SX:
    """Return a share of a segment, clipped to the range from 0 to 1."""
    return ca.fmin(ca.fmax(share, 0), 1)
