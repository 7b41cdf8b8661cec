"""Compiled test whether closed bodies interfere: edges of one that pass triangles of the other, and how deep they reach."""

import math
from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled, inlined_uncounted, uncounted
from tolcontact.geometry.vector_kernel import (
    along,
    cross,
    dot,
    half_solid_angle,
    minus,
    move,
    move_back,
    row,
    row_of,
    turn_back,
)

LEAF = 4  # triangles in a leaf of a BoxTree
MANY = 8  # triangles of a facet: with more, only triangles near the point where an edge passes their plane are tested
ROUNDED = 1e-9  # of coordinates: the largest error of a point


class Side(NamedTuple):
    """A body of a pair.

    vertices    (v, 3) [mm], without deviations
    moved       (v,): index of each vertex among those that deviations move, -1 for others
    motions     (m, j, 3) [mm]: how far a unit of each deviation moves these
    deviations  (n, j) that move them
    shifts      (m, 3) [mm]: how far they move in one realization; see `deviate`
    faces       (t, 3)
    planes      (t, 4): outward normal n and level n . x of each triangle; NaN for triangles that deviations move
    edges       (e, 2), those nominally nearest to the other body first
    sides       (e, 2): the facets at each edge
    outward     (e, 3): sums of the outward normals of the facets that meet at each edge
    distances   (e,) [mm]: lower bounds of their nominal distances from it
    facets      (f, 10): of each facet, triangles in one plane, its box (6), normal n and level n . x; NaN if it is not flat
    facet_of    (t,): the facet of each triangle
    members, first_members   the triangles of each facet, as in a CSR matrix
    vertices_of_facets   (f, 3): three vertices of facets that deviations move, -1 for others
    starts, listed, reaches   the facets near each edge, as in a CSR matrix, the nearest first, with their nominal distances
    reach       [mm]: the largest distance of near facets
    triangles, boxes, next   its BoxTree
    bounds      (8, 3) [mm]: corners of a box that holds the body
    witnesses   (c,): a vertex of each connected component, nominally far from the surface of the other body
    clearances  (c,) [mm]: lower bounds of that distance
    is_in       (c,): whether that vertex lies nominally in the other body
    """

    vertices: np.ndarray
    moved: np.ndarray
    motions: np.ndarray
    deviations: np.ndarray
    shifts: np.ndarray
    faces: np.ndarray
    planes: np.ndarray
    edges: np.ndarray
    sides: np.ndarray
    outward: np.ndarray
    distances: np.ndarray
    facets: np.ndarray
    facet_of: np.ndarray
    members: np.ndarray
    first_members: np.ndarray
    vertices_of_facets: np.ndarray
    starts: np.ndarray
    listed: np.ndarray
    reaches: np.ndarray
    reach: float
    triangles: np.ndarray
    boxes: np.ndarray
    next: np.ndarray
    bounds: np.ndarray
    witnesses: np.ndarray
    clearances: np.ndarray
    is_in: np.ndarray


@uncounted
def deviate(side, k):  # type: ignore[no-untyped-def]
    """Move the vertices of a body as in realization k; return how far [mm] they move at most."""
    square, columns = 0.0, side.motions.shape[1]
    for m in range(side.motions.shape[0]):
        shift = (0.0, 0.0, 0.0)
        for j in range(columns):
            shift = along(shift, side.deviations[k, j], row_of(side.motions, m, j))
        side.shifts[m, 0], side.shifts[m, 1], side.shifts[m, 2] = shift
        square = max(square, dot(shift, shift))
    return math.sqrt(square)


@inlined_uncounted
def vertex(side, number):  # type: ignore[no-untyped-def]
    """Return a vertex of a body in the present realization."""
    m, x = side.moved[number], row(side.vertices, number)
    return x if m < 0 else along(x, 1.0, row(side.shifts, m))


@inlined_uncounted
def corners_of(side, triangle):  # type: ignore[no-untyped-def]
    """Return the corners of a triangle in the present realization."""
    faces = side.faces
    return (
        vertex(side, faces[triangle, 0]), vertex(side, faces[triangle, 1]), vertex(side, faces[triangle, 2]),
    )  # fmt: skip


@inlined_uncounted
def crossing(side, triangle, p, q):  # type: ignore[no-untyped-def]
    """Return the share of the segment from p to q at which it passes a triangle, and its sense: -1 inwards, 1 outwards, 0 none.

    Points on the edges of the triangle count, so that no segment slips between two triangles.
    """
    planes, is_known = side.planes, side.planes[triangle, 3] == side.planes[triangle, 3]
    if is_known:
        n = (planes[triangle, 0], planes[triangle, 1], planes[triangle, 2])
        start, end = dot(n, p) - planes[triangle, 3], dot(n, q) - planes[triangle, 3]
        if start * end > 0.0 or start == end:
            return 0.0, 0
    a, b, c = corners_of(side, triangle)
    if not is_known:
        n = cross(minus(b, a), minus(c, a))
        start, end = dot(n, minus(p, a)), dot(n, minus(q, a))
        if start * end > 0.0 or start == end:
            return 0.0, 0
    d, u, v, w = minus(q, p), minus(a, p), minus(b, p), minus(c, p)
    volume_1, volume_2, volume_3 = dot(d, cross(u, v)), dot(d, cross(v, w)), dot(d, cross(w, u))
    is_through = (volume_1 >= 0.0 and volume_2 >= 0.0 and volume_3 >= 0.0) or (
        volume_1 <= 0.0 and volume_2 <= 0.0 and volume_3 <= 0.0
    )
    return start / (start - end), 0 if not is_through else (-1 if end < start else 1)


@inlined_uncounted
def passes(side, p, q, shares, senses):  # type: ignore[no-untyped-def]
    """Write shares, in order, and senses of the passes of the segment from p to q through the surface; return their number."""
    low, high = (min(p[0], q[0]), min(p[1], q[1]), min(p[2], q[2])), (max(p[0], q[0]), max(p[1], q[1]), max(p[2], q[2]))
    return passes_in(side, low, high, p, q, shares, senses)


@uncounted
def passes_in(side, low, high, p, q, shares, senses):  # type: ignore[no-untyped-def]
    """Write and return what `passes` does, of triangles whose boxes reach into a box from `low` to `high`."""
    count, node, inner = 0, 0, side.next.size // 2
    boxes = side.boxes
    while node < side.next.size:
        if (
            boxes[node, 0] > high[0] or boxes[node, 1] > high[1] or boxes[node, 2] > high[2]
            or boxes[node, 3] < low[0] or boxes[node, 4] < low[1] or boxes[node, 5] < low[2]
        ):  # fmt: skip
            node = side.next[node]
            continue
        if node < inner:
            node = 2 * node + 1
            continue
        for j in range(LEAF):
            triangle = side.triangles[node - inner, j]
            if triangle < 0:
                break
            share, sense = crossing(side, triangle, p, q)
            if sense != 0 and count < shares.size:
                place = count
                while place > 0 and shares[place - 1] > share:
                    shares[place], senses[place], place = shares[place - 1], senses[place - 1], place - 1
                shares[place], senses[place], count = share, sense, count + 1
        node = side.next[node]
    return count


@uncounted
def near_count(distances, motion):  # type: ignore[no-untyped-def]
    """Return how many of the edges, at `distances` (e,) that ascend, may reach a body that moves by `motion` [mm] at most."""
    low, high = 0, distances.size
    while low < high:
        middle = (low + high) // 2
        if distances[middle] <= motion:
            low = middle + 1
        else:
            high = middle
    return low


@uncounted
def _holds(owner, target, X, is_forward, motion):  # type: ignore[no-untyped-def]
    """Return whether a component of a body lies in the other one, given that their surfaces do not cross."""
    for c in range(owner.witnesses.size):
        if owner.clearances[c] > motion:
            if owner.is_in[c]:
                return True
            continue
        p = vertex(owner, owner.witnesses[c])
        p = move(X, p) if is_forward else move_back(X, p)
        if is_beyond(target, p):
            continue
        if is_within(target, p):
            return True
    return False


@uncounted
def is_within(side, p):  # type: ignore[no-untyped-def]
    """Return whether p lies in a body: its triangles fill all solid angles."""
    total = 0.0
    for t in range(side.faces.shape[0]):
        a, b, c = corners_of(side, t)
        total += half_solid_angle(minus(a, p), minus(b, p), minus(c, p))
    return total > math.pi


@inlined_uncounted
def is_beyond(side, p):  # type: ignore[no-untyped-def]
    """Return whether p lies outside of the box of a body."""
    boxes = side.boxes
    return (
        p[0] < boxes[0, 0] or p[1] < boxes[0, 1] or p[2] < boxes[0, 2]
        or p[0] > boxes[0, 3] or p[1] > boxes[0, 4] or p[2] > boxes[0, 5]
    )  # fmt: skip


@uncounted
def motion_of(X, bounds):  # type: ignore[no-untyped-def]
    """Return how far a pose X (12,) moves any point of a box with corners `bounds` (8, 3) at most."""
    largest = 0.0
    for j in range(bounds.shape[0]):
        arm = minus(move(X, row(bounds, j)), row(bounds, j))
        largest = max(largest, dot(arm, arm))
    return math.sqrt(largest)


@inlined_uncounted
def misses(boxes, k, p, q):  # type: ignore[no-untyped-def]
    """Return whether the box around p and q misses box k."""
    return (
        boxes[k, 0] > max(p[0], q[0]) or boxes[k, 3] < min(p[0], q[0]) or boxes[k, 1] > max(p[1], q[1])
        or boxes[k, 4] < min(p[1], q[1]) or boxes[k, 2] > max(p[2], q[2]) or boxes[k, 5] < min(p[2], q[2])
    )  # fmt: skip


@inlined_uncounted
def _heights(side, f, p, q):  # type: ignore[no-untyped-def]
    """Return heights of p and q over the plane of a facet: both 1 if their segment misses its box.

    For facets that are not flat they are 1 and -1, since nothing is known of them.
    """
    facets = side.facets
    if misses(facets, f, p, q):
        return 1.0, 1.0
    if side.vertices_of_facets[f, 0] >= 0:
        a = vertex(side, side.vertices_of_facets[f, 0])
        b, c = vertex(side, side.vertices_of_facets[f, 1]), vertex(side, side.vertices_of_facets[f, 2])
        n = cross(minus(b, a), minus(c, a))
        return dot(n, minus(p, a)), dot(n, minus(q, a))
    if facets[f, 9] != facets[f, 9]:
        return 1.0, -1.0
    n = (facets[f, 6], facets[f, 7], facets[f, 8])
    return dot(n, p) - facets[f, 9], dot(n, q) - facets[f, 9]


@uncounted
def _passes_facet(side, f, p, q, start, end, shares, senses):  # type: ignore[no-untyped-def]
    """Return whether the segment from p to q, at heights `start` and `end` over a flat facet, passes a triangle near there."""
    n = (side.facets[f, 6], side.facets[f, 7], side.facets[f, 8])
    size = 1.0 + max(abs(p[0]), abs(p[1]), abs(p[2]), abs(q[0]), abs(q[1]), abs(q[2]))
    margin, share = ROUNDED * size, start / (start - end)
    spare = margin * math.sqrt(dot(n, n)) / abs(start - end)  # the flatter the angle, the less certain the point
    x, y = along(p, max(share - spare, 0.0), minus(q, p)), along(p, min(share + spare, 1.0), minus(q, p))
    low = (min(x[0], y[0]) - margin, min(x[1], y[1]) - margin, min(x[2], y[2]) - margin)
    high = (max(x[0], y[0]) + margin, max(x[1], y[1]) + margin, max(x[2], y[2]) + margin)
    return passes_in(side, low, high, p, q, shares, senses) > 0


@uncounted
def _passes_listed(side, f, p, q, start, end, shares, senses):  # type: ignore[no-untyped-def]
    """Return whether the segment from p to q passes a facet, or any other one near it if the facet is not flat.

    start, end   heights of p and q over its plane, not of the same sign
    """
    first, last = side.first_members[f], side.first_members[f + 1]
    if last - first > MANY:
        if side.facets[f, 9] == side.facets[f, 9]:
            return _passes_facet(side, f, p, q, start, end, shares, senses)
        return passes(side, p, q, shares, senses) > 0
    for place in range(first, last):
        _, sense = crossing(side, side.members[place], p, q)
        if sense != 0:
            return True
    return False


@uncounted
def _passes_any(owner, target, X, is_forward, motion, deviation, shares, senses):  # type: ignore[no-untyped-def]
    """Return whether an edge passes the surface of the other body; `motion` and `deviation` bound how far points move [mm]."""
    motion += deviation
    is_listed = motion <= owner.reach
    for j in range(near_count(owner.distances, motion)):
        first, last = owner.starts[j], owner.starts[j + 1]
        if is_listed and (first == last or owner.reaches[first] > motion):
            continue
        start, end = vertex(owner, owner.edges[j, 0]), vertex(owner, owner.edges[j, 1])
        p, q = (move(X, start), move(X, end)) if is_forward else (move_back(X, start), move_back(X, end))
        if misses(target.boxes, 0, p, q):
            continue
        if not is_listed:
            if passes(target, p, q, shares, senses) > 0:
                return True
            continue
        step_p, step_q = minus(p, start), minus(q, end)  # no point of an edge moves further than both of its ends
        nearest = min(motion, deviation + math.sqrt(max(dot(step_p, step_p), dot(step_q, step_q))))
        for m in range(first, last):
            if owner.reaches[m] > nearest:
                break
            # Before the call, which copies the arrays of the body and takes ten times as long.
            height_p, height_q = _heights(target, owner.listed[m], p, q)
            if height_p * height_q > 0.0 or height_p == height_q:
                continue
            if _passes_listed(target, owner.listed[m], p, q, height_p, height_q, shares, senses):
                return True
    return False


@compiled
def interfere(A, B, poses, interferes):  # type: ignore[no-untyped-def]
    """Write whether (n,) body A interferes with body B at its poses X_BA (n, 12) in the frame of B.

    It does if an edge of one passes a triangle of the other, or else if one holds a component of the other.
    """
    shares, senses = np.empty(1), np.empty(1, dtype=np.int64)
    for k in range(poses.shape[0]):
        X = poses[k]
        motion, deviation = motion_of(X, A.bounds), 2.0 * (deviate(A, k) + deviate(B, k))
        interferes[k] = (
            _passes_any(A, B, X, True, motion, deviation, shares, senses)
            or _passes_any(B, A, X, False, motion, deviation, shares, senses)
            or _holds(A, B, X, True, motion + deviation)
            or _holds(B, A, X, False, motion + deviation)
        )


@compiled
def relative(X_WA, X_WB, X_BA):  # type: ignore[no-untyped-def]
    """Write the poses X_BA (n, 12) of A in the frame of B."""
    for k in range(X_BA.shape[0]):
        A, B = X_WA[k], X_WB[k]
        for j in range(3):
            X_BA[k, j], X_BA[k, 3 + j], X_BA[k, 6 + j] = turn_back(B, (A[j], A[3 + j], A[6 + j]))
        X_BA[k, 9], X_BA[k, 10], X_BA[k, 11] = move_back(B, (A[9], A[10], A[11]))
