"""The clearance of two plane faces at any pose: the minimum height within their overlap region at that pose.

Heights are linear over this region, so the minimum is at one of its corners. A corner of the region is a corner of one outline
inside the other, or a crossing of edges of both, as seen along the normal of the reference face.
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from tolcontact.discretization.measured_geometry import PlaneClearance
from tolcontact.mechanics.pose import Pose

NO_HEIGHT = 1e300  # height of a corner that the region does not have
MARGIN = 1e-9  # of an edge: crossings at its end count
MIN_CROSS = 1e-12  # of the product of the lengths of two edges: nearly parallel ones do not cross


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
    clearance_of_region = ca.mmin(ca.vertcat(*candidates))
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
