"""The clearance of two plane faces at any pose: the least height within the region in which they overlap there.

Heights are linear over this region, so that the least is at one of its corners: a corner of either outline inside the other
one, or a place where edges of both cross, as seen along the normal of the reference face.
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from tolcontact.discretization.measured_geometry import PlaneClearance
from tolcontact.mechanics.pose import Pose

NONE = 1e300  # height of a corner that the region does not have
MARGIN = 1e-9  # of an edge: crossings at its end count
MIN_CROSS = 1e-12  # of the product of the lengths of two edges: nearly parallel ones do not cross


def plane_clearance(clearance: PlaneClearance, X_21: Pose, otherwise: ca.SX) -> ca.SX:
    """Return the clearance [mm] at the pose of the moving face relative to the reference; `otherwise` without overlap."""
    moving, reference = clearance.outlines
    o, n = clearance.planes[1].origin, clearance.planes[1].axis
    across = np.linalg.svd(n[None])[2][1:]
    moved = [X_21.apply(ca.DM(vertex)) - ca.DM(o) for vertex in moving.vertices]
    p, heights = [ca.DM(across) @ place for place in moved], [ca.dot(ca.DM(n), place) for place in moved]
    q = [ca.SX(ca.DM(place)) for place in (reference.vertices - o) @ across.T]
    edges_p, edges_q = ([(ends[a], ends[b]) for a, b in outline.edges] for ends, outline in ((p, moving), (q, reference)))
    plane, normal = X_21.apply(ca.DM(clearance.planes[0].origin)), X_21.R @ ca.DM(clearance.planes[0].axis)
    candidates = [ca.if_else(_is_inside(place, edges_q), height, NONE) for place, height in zip(p, heights, strict=True)]
    candidates += [
        ca.if_else(_is_inside(place, edges_p), ca.dot(normal, ca.DM(vertex) - plane), NONE)
        for place, vertex in zip(q, reference.vertices, strict=True)
    ]
    ends = [(heights[a], heights[b]) for a, b in moving.edges]
    candidates += [
        _crossing(edge, other, *edge_heights) for edge, edge_heights in zip(edges_p, ends, strict=True) for other in edges_q
    ]
    least = ca.mmin(ca.vertcat(*candidates))
    return ca.if_else(least < NONE, least, otherwise)


def _is_inside(place: ca.SX, edges: Sequence[tuple[ca.SX, ca.SX]]) -> ca.SX:
    """Return whether a place (2, 1) is inside an outline: a ray from it crosses an odd number of edges."""
    parity = ca.SX(1)
    for start, end in edges:
        spans = (start[1] > place[1]) != (end[1] > place[1])
        at = start[0] + (place[1] - start[1]) * (end[0] - start[0]) / _nonzero(end[1] - start[1])
        parity *= ca.if_else(ca.logic_and(spans, place[0] < at), -1, 1)
    return parity < 0


def _crossing(edge: tuple[ca.SX, ca.SX], other: tuple[ca.SX, ca.SX], start: ca.SX, end: ca.SX) -> ca.SX:
    """Return the height where an edge crosses another one, from those of its ends; NONE if it does not."""
    r, s, gap = edge[1] - edge[0], other[1] - other[0], other[0] - edge[0]
    cross = _cross(r, s)
    share, other_share = _cross(gap, s) / _nonzero(cross), _cross(gap, r) / _nonzero(cross)
    is_crossing = cross**2 > MIN_CROSS**2 * ca.sumsqr(r) * ca.sumsqr(s)
    for value in (share, other_share):
        is_crossing = ca.logic_and(is_crossing, ca.fabs(value - 0.5) <= 0.5 + MARGIN)
    return ca.if_else(is_crossing, start + share * (end - start), NONE)


def _cross(a: ca.SX, b: ca.SX) -> ca.SX:
    return a[0] * b[1] - a[1] * b[0]


def _nonzero(value: ca.SX) -> ca.SX:
    return ca.if_else(value == 0, 1, value)
