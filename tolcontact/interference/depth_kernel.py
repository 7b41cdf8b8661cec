"""Compiled depths of bodies that interfere: how far edges and triangles of one lie below the surface of the other."""

import math

import numpy as np

from tolcontact.compiled import compiled, inlined_uncounted, uncounted
from tolcontact.geometry.vector_kernel import along, dot, minus, move, move_back, scaled
from tolcontact.interference.kernel import (
    LEAF,
    corners_of,
    deviate,
    is_beyond,
    is_within,
    motion_of,
    near_count,
    passes,
    vertex,
)
from tolcontact.interference.near_kernel import square_distance

SAMPLES = 4  # of a piece of an edge inside the other body
MAX_PASSES = 64  # of one edge
RAY = (1.0, 0.01307, 0.00713)  # a direction that few edges have, and along which few boxes are passed


@inlined_uncounted
def _nearest_on_triangle(p, a, b, c):  # type: ignore[no-untyped-def]  # noqa: PLR0911
    """Return the point on a triangle that is nearest to p (Ericson, Real-Time Collision Detection, 5.1.5)."""
    ab, ac, ap, bp, cp = minus(b, a), minus(c, a), minus(p, a), minus(p, b), minus(p, c)
    d1, d2, d3, d4, d5, d6 = dot(ab, ap), dot(ac, ap), dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    if d3 >= 0.0 and d4 <= d3:
        return b
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return along(a, d1 / (d1 - d3), ab)
    if d6 >= 0.0 and d5 <= d6:
        return c
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return along(a, d2 / (d2 - d6), ac)
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        return along(b, (d4 - d3) / ((d4 - d3) + (d5 - d6)), minus(c, b))
    total = va + vb + vc
    return along(along(a, vb / total, ab), vc / total, ac)


@uncounted
def _seems_within(side, p, shares, senses):  # type: ignore[no-untyped-def]
    """Return whether a ray from p leaves a body where it first passes the surface; a ray along an edge may be wrong."""
    boxes = side.boxes
    reach = 2.0 * (boxes[0, 3] - boxes[0, 0] + boxes[0, 4] - boxes[0, 1] + boxes[0, 5] - boxes[0, 2])
    return passes(side, p, along(p, reach, RAY), shares, senses) > 0 and senses[0] > 0


@uncounted
def _near_leaf(side, p):  # type: ignore[no-untyped-def]
    """Return an upper bound of the squared distance of p from the surface: its distance from a leaf with a near box."""
    node, inner, square = 0, side.next.size // 2, np.inf
    while node < inner:
        left, right = 2 * node + 1, 2 * node + 2
        node = left if square_distance(side.boxes, left, p, p) <= square_distance(side.boxes, right, p, p) else right
    for j in range(LEAF):
        triangle = side.triangles[node - inner, j]
        if triangle < 0:
            break
        a, b, c = corners_of(side, triangle)
        arm = minus(p, _nearest_on_triangle(p, a, b, c))
        square = min(square, dot(arm, arm))
    return square * (1.0 + 1e-12)


@uncounted
def _nearest(side, p, enough):  # type: ignore[no-untyped-def]
    """Return the distance of p from the surface, the triangle and the place there; any if the distance is below `enough`."""
    node, inner, best, foot, square = 0, side.next.size // 2, -1, p, np.inf
    bound = _near_leaf(side, p)
    while node < side.next.size:
        if square_distance(side.boxes, node, p, p) > min(square, bound):
            node = side.next[node]
            continue
        if node < inner:
            node = 2 * node + 1
            continue
        for j in range(LEAF):
            triangle = side.triangles[node - inner, j]
            if triangle < 0:
                break
            a, b, c = corners_of(side, triangle)
            place = _nearest_on_triangle(p, a, b, c)
            arm = minus(p, place)
            if dot(arm, arm) < square:
                square, best, foot = dot(arm, arm), triangle, place
        if square < enough * enough:
            break
        node = side.next[node]
    return math.sqrt(square), best, foot


@inlined_uncounted
def _write(k, X, is_forward, depth, own, triangle, place, foot, depths, triangles, places):  # type: ignore[no-untyped-def]
    """Write the depth of realization k at a place on a triangle (or edge) of one body, whose foot is on one of the other."""
    depths[k] = depth
    place_A, place_B = (place, foot) if is_forward else (move(X, foot), move(X, place))
    triangles[k, 0], triangles[k, 1] = (own, triangle) if is_forward else (triangle, own)
    for i in range(3):
        places[k, 0, i], places[k, 1, i] = place_A[i], place_B[i]


@uncounted
def _sound(target, k, X, is_forward, p, q, edge, depths, triangles, places):  # type: ignore[no-untyped-def]
    """Raise the depth of realization k to the depth of the edge segment from p to q, which lies in the other body."""
    for j in range(SAMPLES + 1):
        place = along(p, j / SAMPLES, minus(q, p))
        depth, triangle, foot = _nearest(target, place, depths[k])
        if depth > depths[k]:
            _write(k, X, is_forward, depth, -1 - edge, triangle, place, foot, depths, triangles, places)


@uncounted
def _sound_edges(owner, target, k, X, is_forward, motion, is_in, shares, senses, depths, triangles, places):  # type: ignore
    """Raise the depth of realization k to the depth of one body's edges in the other; `is_in` (v,) is false before."""
    for is_first in (True, False):
        changes = True
        while changes:
            changes = False
            for j in range(near_count(owner.distances, motion) if is_first else owner.edges.shape[0]):
                i, m = owner.edges[j, 0], owner.edges[j, 1]
                if not is_first and is_in[i] == is_in[m]:
                    continue
                p, q = vertex(owner, i), vertex(owner, m)
                p, q = (move(X, p), move(X, q)) if is_forward else (move_back(X, p), move_back(X, q))
                count = passes(target, p, q, shares, senses)
                if is_first and count > 0:
                    start, was_in = 0.0, senses[0] > 0
                    is_in[i] = is_in[i] or was_in
                    for place in range(count):
                        if was_in:
                            _sound(
                                target, k, X, is_forward, along(p, start, minus(q, p)),
                                along(p, shares[place], minus(q, p)), j, depths, triangles, places,
                            )  # fmt: skip
                        start, was_in = shares[place], senses[place] < 0
                    if was_in:
                        _sound(target, k, X, is_forward, along(p, start, minus(q, p)), q, j, depths, triangles, places)
                    is_in[m] = is_in[m] or was_in
                elif not is_first and count == 0:
                    is_in[i], is_in[m], changes = True, True, True
                    _sound(target, k, X, is_forward, p, q, j, depths, triangles, places)


@uncounted
def _sound_centres(owner, target, k, X, is_forward, shares, senses, depths, triangles, places):  # type: ignore[no-untyped-def]
    """Raise the depth of realization k to the depth of triangle centres of one body that lie deeper in the other than edges.

    Where faces are flush, edges lie on the surface, and only the area between them is inside.
    """
    for t in range(owner.faces.shape[0]):
        a, b, c = corners_of(owner, t)
        p = scaled(1.0 / 3.0, along(along(a, 1.0, b), 1.0, c))
        p = move(X, p) if is_forward else move_back(X, p)
        if is_beyond(target, p) or not _seems_within(target, p, shares, senses):
            continue
        depth, triangle, foot = _nearest(target, p, depths[k])
        if depth > depths[k] and is_within(target, p):
            _write(k, X, is_forward, depth, t, triangle, p, foot, depths, triangles, places)


@compiled
def sound(A, B, poses, depths, triangles, places):  # type: ignore[no-untyped-def]
    """Write the penetration of bodies at poses X_BA (n, 12) of realizations that interfere.

    The penetration is the largest depth below the surface of one body among sample points of the other, on its edges and at the
    centres of its triangles.

    depths      (n,) [mm]
    triangles   (n, 2): of A and of B, the triangle that contains that point or is nearest to it; -1 minus an edge
    places      (n, 2, 3) [mm], in the frame of B: of A and of B, the sample point and the nearest point on the surface
    """
    shares, senses = np.empty(MAX_PASSES), np.empty(MAX_PASSES, dtype=np.int64)
    for k in range(poses.shape[0]):
        depths[k], triangles[k, :], places[k] = 0.0, 0, 0.0
        X = poses[k]
        motion = motion_of(X, A.bounds) + 2.0 * (deviate(A, k) + deviate(B, k))
        in_B, in_A = np.zeros(A.vertices.shape[0], dtype=np.bool_), np.zeros(B.vertices.shape[0], dtype=np.bool_)
        _sound_edges(A, B, k, X, True, motion, in_B, shares, senses, depths, triangles, places)
        _sound_edges(B, A, k, X, False, motion, in_A, shares, senses, depths, triangles, places)
        _sound_centres(A, B, k, X, True, shares, senses, depths, triangles, places)
        _sound_centres(B, A, k, X, False, shares, senses, depths, triangles, places)
