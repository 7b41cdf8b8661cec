"""The clearance of two faces by their triangles at any pose: the least distance of corners, facets and edges.

A corner counts as the nearest facet over or under which it is says: as its height, negative inside the material. Edges that may
touch first count as the distance of their lines along the common normal, negative where they have passed each other. All other
distances are of the nearest places of both edges. Elements that are not looked at are farther apart than the horizon, less what
the moving face has moved relative to the reference one; the clearance is never larger than that.
"""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.discretization.measured_geometry import MeshClearance
from tolcontact.geometry.nearest_elements import Corners, EdgePairs
from tolcontact.mechanics.pose import Pose

NONE = 1e300  # height of a corner that is over no facet
MARGIN = 1e-9  # of a facet: how far beside it a corner counts
MIN_SQUARE = 1e-300  # of a length: keeps quotients finite where a segment has no length


def mesh_clearance(clearance: MeshClearance, X_21: Pose) -> ca.SX:
    """Return the clearance [mm] at the pose of the moving face relative to the reference one."""
    elements = clearance.elements
    X_12 = Pose(X_21.R.T, -X_21.R.T @ X_21.t)
    values = [*_heights(elements.corners[0], X_21), *_heights(elements.corners[1], X_12)]
    values += _edge_distances(elements.edges, X_21)
    motion = ca.vertcat(*(ca.norm_2(X_21.apply(ca.DM(corner)) - ca.DM(corner)) for corner in clearance.box))
    return least([*values, elements.horizon - ca.mmax(motion)])


def _heights(corners: Corners, X: Pose) -> list[ca.SX]:
    """Return the height [mm] of each corner at pose X over the nearest facet over which it is, NONE if there is none."""
    heights = []
    for number in np.unique(corners.indices):
        rows = np.flatnonzero(corners.indices == number)
        place, nearest = X.apply(ca.DM(corners.points[rows[0]])), ca.SX(NONE)
        for row in rows:
            height = _height(place, corners.triangles[row], corners.slopes[row])
            nearest = ca.if_else(ca.fabs(height) < ca.fabs(nearest), height, nearest)
        heights.append(nearest)
    return heights


def _height(place: ca.SX, triangle: np.ndarray, slopes: np.ndarray) -> ca.SX:
    """Return the height of a place (3, 1) over a triangle (3, 3); NONE if the place is not over or under it.

    Under facets that lean towards each other the border is halfway between them.
    """
    along = np.roll(triangle, -1, axis=0) - triangle
    n = np.cross(along[0], along[1])
    n /= np.linalg.norm(n)
    inward = np.cross(n, along)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    height = ca.dot(ca.DM(n), place) - float(n @ triangle[0])
    depth, margin = ca.fmax(-height, 0), MARGIN * float(np.linalg.norm(along, axis=1).max())
    is_over = ca.SX(1)
    for corner, direction, slope in zip(triangle, inward, slopes, strict=True):
        beside = ca.dot(ca.DM(direction), place) - float(direction @ corner)
        is_over = ca.logic_and(is_over, beside + (float(slope) * depth if slope else 0) >= -margin)
    return ca.if_else(is_over, height, NONE)


def _edge_distances(pairs: EdgePairs, X: Pose) -> list[ca.SX]:
    """Return the distance [mm] of each edge at pose X from the other edge of its pair."""
    distances = []
    for left, right, sense in zip(pairs.left, pairs.right, pairs.senses, strict=True):
        p, q = [X.apply(ca.DM(end)) for end in left], [ca.SX(ca.DM(end)) for end in right]
        apart = segment_distance(p, q)
        if sense:
            u, v, r = p[1] - p[0], q[1] - q[0], q[0] - p[0]
            n = ca.cross(u, v)
            square = ca.fmax(ca.sumsqr(n), MIN_SQUARE)
            shares = ca.dot(ca.cross(r, v), n) / square, ca.dot(ca.cross(r, u), n) / square
            is_inner = ca.logic_and(*(ca.logic_and(share > 0, share < 1) for share in shares))
            apart = ca.if_else(is_inner, -float(sense) * ca.dot(n, r) / ca.sqrt(square), apart)
        distances.append(apart)
    return distances


def least(values: Any) -> ca.SX:
    """Return the least of several expressions."""
    return ca.mmin(ca.vertcat(*values))


def segment_distance(moving: Sequence[ca.SX], reference: Sequence[ca.SX]) -> ca.SX:
    """Return the shortest distance [mm] of two segments between ends (3, 1); parallel ones are no exception.

    It is the least of five: from each end to the other segment, and between the places where the two lines are nearest if
    both lie between the ends (Ericson, Real-Time Collision Detection, 5.1.9). All are distances of places of both segments, so
    where lines are almost parallel, and these places uncertain, none is too short.
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
    return ca.sqrt(least(squares))


def clipped(share: ca.SX) -> ca.SX:
    """Return a share of a segment, at its ends if it lies beyond them."""
    return ca.fmin(ca.fmax(share, 0), 1)
