"""Compiled test whether closed bodies interfere: edges of one that pass triangles of the other, and how deep they do."""

import math
from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled, inlined_uncounted, uncounted
from tolcontact.geometry.vector_kernel import along, cross, dot, minus, move, move_back, row, row_of, scaled, turn

LEAF = 4
MIN_SINE = 1e-3  # of the angle between edges that have a common normal
SAMPLES = 4  # of a piece of an edge inside the other body
MAX_PASSES = 64  # of one edge
MAX_POINTS = 512  # of the common region of two bodies
MAX_NORMALS = 256
MAX_CROSSING = 12  # edges of each body whose common normals are compared


class Side(NamedTuple):
    """A body of a pair.

    vertices    (v, 3) [mm], without deviations
    moved       (v,): index of each vertex among those that deviations move, -1 for others
    shifts      (n, m, 3) [mm]: how far deviations move these, in each realization
    faces       (t, 3)
    planes      (t, 4): outward normal n and level n . x of each triangle; NaN for triangles that deviations move
    edges       (e, 2), those nominally nearest to the other body first
    outward     (e, 3): sums of the outward normals of the facets that meet at each edge
    distances   (e,) [mm]: bounds from below of their nominal distances from it
    facets      (f, 10): of each facet, triangles in one plane, its box (6), normal n and level n . x
    members, first_members   the triangles of each facet, as in a CSR matrix
    vertices_of_facets   (f, 3): three vertices of facets that deviations move, -1 for others
    starts, near, reaches   the facets `near` each edge, as in a CSR matrix, the nearest first, with their nominal distances
    reach       [mm] up to which facets are near
    triangles, boxes, next   its BoxTree
    spare       [mm] by which deviations move a vertex at most
    bounds      (8, 3) [mm]: corners of a box that holds the body
    witnesses   (c,): a vertex of each connected component, nominally far from the surface of the other body
    far         (c,) [mm]: bounds from below of that distance
    is_in       (c,): whether that vertex lies nominally in the other body
    """

    vertices: np.ndarray
    moved: np.ndarray
    shifts: np.ndarray
    faces: np.ndarray
    planes: np.ndarray
    edges: np.ndarray
    outward: np.ndarray
    distances: np.ndarray
    facets: np.ndarray
    members: np.ndarray
    first_members: np.ndarray
    vertices_of_facets: np.ndarray
    starts: np.ndarray
    near: np.ndarray
    reaches: np.ndarray
    reach: float
    triangles: np.ndarray
    boxes: np.ndarray
    next: np.ndarray
    spare: float
    bounds: np.ndarray
    witnesses: np.ndarray
    far: np.ndarray
    is_in: np.ndarray


@inlined_uncounted
def _corner(side, k, number):  # type: ignore[no-untyped-def]
    """Return a vertex of a body in realization k."""
    m, x = side.moved[number], row(side.vertices, number)
    return x if m < 0 else along(x, 1.0, row_of(side.shifts, k, m))


@inlined_uncounted
def _triangle(side, k, triangle):  # type: ignore[no-untyped-def]
    """Return the corners of a triangle in realization k."""
    faces = side.faces
    return (
        _corner(side, k, faces[triangle, 0]), _corner(side, k, faces[triangle, 1]), _corner(side, k, faces[triangle, 2]),
    )  # fmt: skip


@inlined_uncounted
def _share(side, k, triangle, p, q):  # type: ignore[no-untyped-def]
    """Return the share of the segment from p to q at which it passes a triangle, and its sense: -1 inwards, 1 outwards, 0 none.

    Places on the edges of the triangle count, so that none gets through between two triangles.
    """
    planes, is_known = side.planes, side.planes[triangle, 3] == side.planes[triangle, 3]
    if is_known:
        n = (planes[triangle, 0], planes[triangle, 1], planes[triangle, 2])
        start, end = dot(n, p) - planes[triangle, 3], dot(n, q) - planes[triangle, 3]
        if start * end > 0.0 or start == end:
            return 0.0, 0
    a, b, c = _triangle(side, k, triangle)
    if not is_known:
        n = cross(minus(b, a), minus(c, a))
        start, end = dot(n, minus(p, a)), dot(n, minus(q, a))
        if start * end > 0.0 or start == end:
            return 0.0, 0
    d, u, v, w = minus(q, p), minus(a, p), minus(b, p), minus(c, p)
    first, second, third = dot(d, cross(u, v)), dot(d, cross(v, w)), dot(d, cross(w, u))
    is_through = (first >= 0.0 and second >= 0.0 and third >= 0.0) or (first <= 0.0 and second <= 0.0 and third <= 0.0)
    return start / (start - end), 0 if not is_through else (-1 if end < start else 1)


@inlined_uncounted
def _passes(side, k, p, q, shares, senses):  # type: ignore[no-untyped-def]
    """Write at which shares, in order, and in which senses the segment from p to q passes the surface; return how often."""
    count, node, inner = 0, 0, side.next.size // 2
    low_x, low_y, low_z = min(p[0], q[0]), min(p[1], q[1]), min(p[2], q[2])
    high_x, high_y, high_z = max(p[0], q[0]), max(p[1], q[1]), max(p[2], q[2])
    boxes = side.boxes
    while node < side.next.size:
        if (
            boxes[node, 0] > high_x or boxes[node, 1] > high_y or boxes[node, 2] > high_z
            or boxes[node, 3] < low_x or boxes[node, 4] < low_y or boxes[node, 5] < low_z
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
            share, sense = _share(side, k, triangle, p, q)
            if sense != 0 and count < shares.size:
                place = count
                while place > 0 and shares[place - 1] > share:
                    shares[place], senses[place], place = shares[place - 1], senses[place - 1], place - 1
                shares[place], senses[place], count = share, sense, count + 1
        node = side.next[node]
    return count


@uncounted
def _near_count(distances, motion):  # type: ignore[no-untyped-def]
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
def _holds(owner, other, k, X, is_forward, motion):  # type: ignore[no-untyped-def]
    """Return whether a component of a body lies in the other one, if its surface passes that one's nowhere."""
    for c in range(owner.witnesses.size):
        if owner.far[c] > motion:
            if owner.is_in[c]:
                return True
            continue
        p = _corner(owner, k, owner.witnesses[c])
        p = move(X, p) if is_forward else move_back(X, p)
        if _is_beyond(other, p):
            continue
        if _is_within(other, k, p):
            return True
    return False


@uncounted
def _is_within(side, k, p):  # type: ignore[no-untyped-def]
    """Return whether p lies in a body: its triangles fill all solid angles (van Oosterom and Strackee, 1983)."""
    total = 0.0
    for t in range(side.faces.shape[0]):
        a, b, c = _triangle(side, k, t)
        a, b, c = minus(a, p), minus(b, p), minus(c, p)
        length_a, length_b, length_c = math.sqrt(dot(a, a)), math.sqrt(dot(b, b)), math.sqrt(dot(c, c))
        near = length_a * length_b * length_c + dot(a, b) * length_c + dot(b, c) * length_a + dot(c, a) * length_b
        total += math.atan2(dot(a, cross(b, c)), near)
    return total > math.pi


@inlined_uncounted
def _is_beyond(side, p):  # type: ignore[no-untyped-def]
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
def _may_pass(other, facets, f, p, q):  # type: ignore[no-untyped-def]
    """Return whether the segment from p to q reaches the box of a facet, and passes its plane."""
    if (
        facets[f, 0] > max(p[0], q[0]) or facets[f, 3] < min(p[0], q[0]) or facets[f, 1] > max(p[1], q[1])
        or facets[f, 4] < min(p[1], q[1]) or facets[f, 2] > max(p[2], q[2]) or facets[f, 5] < min(p[2], q[2])
    ):  # fmt: skip
        return False
    n = (facets[f, 6], facets[f, 7], facets[f, 8])
    return not (dot(n, p) - facets[f, 9]) * (dot(n, q) - facets[f, 9]) > 0.0


@uncounted
def _put_planes(side, k, facets):  # type: ignore[no-untyped-def]
    """Write the planes of the facets that deviations move in realization k."""
    for f in range(facets.shape[0]):
        if side.vertices_of_facets[f, 0] >= 0:
            a = _corner(side, k, side.vertices_of_facets[f, 0])
            b, c = _corner(side, k, side.vertices_of_facets[f, 1]), _corner(side, k, side.vertices_of_facets[f, 2])
            n = cross(minus(b, a), minus(c, a))
            facets[f, 6], facets[f, 7], facets[f, 8], facets[f, 9] = n[0], n[1], n[2], dot(n, a)


@uncounted
def _passes_any(owner, other, facets, k, X, is_forward, motion, shares, senses):  # type: ignore[no-untyped-def]
    """Return whether an edge of a body passes the surface of the other one, whose `facets` are those of realization k."""
    is_listed, boxes = motion <= owner.reach, other.boxes
    for j in range(_near_count(owner.distances, motion)):
        p, q = _corner(owner, k, owner.edges[j, 0]), _corner(owner, k, owner.edges[j, 1])
        p, q = (move(X, p), move(X, q)) if is_forward else (move_back(X, p), move_back(X, q))
        if (
            boxes[0, 0] > max(p[0], q[0]) or boxes[0, 3] < min(p[0], q[0]) or boxes[0, 1] > max(p[1], q[1])
            or boxes[0, 4] < min(p[1], q[1]) or boxes[0, 2] > max(p[2], q[2]) or boxes[0, 5] < min(p[2], q[2])
        ):  # fmt: skip
            continue
        if not is_listed:
            if _passes(other, k, p, q, shares, senses) > 0:
                return True
            continue
        for m in range(owner.starts[j], owner.starts[j + 1]):
            if owner.reaches[m] > motion:
                break
            facet = owner.near[m]
            if _may_pass(other, facets, facet, p, q):
                for place in range(other.first_members[facet], other.first_members[facet + 1]):
                    _, sense = _share(other, k, other.members[place], p, q)
                    if sense != 0:
                        return True
    return False


@compiled
def interfere(A, B, poses, found):  # type: ignore[no-untyped-def]
    """Write whether (n,) body A interferes with body B at its poses X_BA (n, 12) in the frame of B.

    It does if an edge of one passes a triangle of the other, or else if one holds a component of the other.
    """
    shares, senses = np.empty(1), np.empty(1, dtype=np.int64)
    facets_of_A, facets_of_B = A.facets.copy(), B.facets.copy()
    for k in range(poses.shape[0]):
        X = poses[k]
        motion = motion_of(X, A.bounds) + 2.0 * (A.spare + B.spare)
        if A.spare > 0.0:
            _put_planes(A, k, facets_of_A)
        if B.spare > 0.0:
            _put_planes(B, k, facets_of_B)
        found[k] = (
            _passes_any(A, B, facets_of_B, k, X, True, motion, shares, senses)
            or _passes_any(B, A, facets_of_A, k, X, False, motion, shares, senses)
            or _holds(A, B, k, X, True, motion)
            or _holds(B, A, k, X, False, motion)
        )


@inlined_uncounted
def _nearest_on_triangle(p, a, b, c):  # type: ignore[no-untyped-def]  # noqa: PLR0911
    """Return the place on a triangle that is nearest to p (Ericson, Real-Time Collision Detection, 5.1.5)."""
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


@inlined_uncounted
def _box_distance(boxes, node, p):  # type: ignore[no-untyped-def]
    """Return the squared distance of p from the box of a node."""
    x = max(boxes[node, 0] - p[0], 0.0, p[0] - boxes[node, 3])
    y = max(boxes[node, 1] - p[1], 0.0, p[1] - boxes[node, 4])
    z = max(boxes[node, 2] - p[2], 0.0, p[2] - boxes[node, 5])
    return x * x + y * y + z * z


@uncounted
def _nearest(side, k, p, enough):  # type: ignore[no-untyped-def]
    """Return the distance of p from the surface, the triangle and the place there; any if the distance is below `enough`."""
    node, inner, best, foot, least = 0, side.next.size // 2, -1, p, np.inf
    while node < side.next.size:
        if _box_distance(side.boxes, node, p) > least:
            node = side.next[node]
            continue
        if node < inner:
            node = 2 * node + 1
            continue
        for j in range(LEAF):
            triangle = side.triangles[node - inner, j]
            if triangle < 0:
                break
            a, b, c = _triangle(side, k, triangle)
            place = _nearest_on_triangle(p, a, b, c)
            arm = minus(p, place)
            if dot(arm, arm) < least:
                least, best, foot = dot(arm, arm), triangle, place
        if least < enough * enough:
            break
        node = side.next[node]
    return math.sqrt(least), best, foot


@uncounted
def _sound(other, k, X, is_forward, p, q, edge, depths, triangles, places):  # type: ignore[no-untyped-def]
    """Raise the depth of realization k to that of a piece of an edge from p to q, which lies in the other body."""
    for j in range(SAMPLES + 1):
        place = along(p, j / SAMPLES, minus(q, p))
        depth, triangle, foot = _nearest(other, k, place, depths[k])
        if depth > depths[k]:
            depths[k] = depth
            first, second = (place, foot) if is_forward else (move(X, foot), move(X, place))
            triangles[k, 0], triangles[k, 1] = (-1 - edge, triangle) if is_forward else (triangle, -1 - edge)
            for i in range(3):
                places[k, 0, i], places[k, 1, i] = first[i], second[i]


@uncounted
def _sound_edges(owner, other, k, X, is_forward, is_in, shares, senses, depths, triangles, places):  # type: ignore
    """Raise the depth of realization k to that of the edges of a body in the other one; `is_in` (v,) is false before."""
    for is_first in (True, False):
        changes = True
        while changes:
            changes = False
            for j in range(owner.edges.shape[0]):
                i, m = owner.edges[j, 0], owner.edges[j, 1]
                if not is_first and is_in[i] == is_in[m]:
                    continue
                p, q = _corner(owner, k, i), _corner(owner, k, m)
                p, q = (move(X, p), move(X, q)) if is_forward else (move_back(X, p), move_back(X, q))
                count = _passes(other, k, p, q, shares, senses)
                if is_first and count > 0:
                    start, was_in = 0.0, senses[0] > 0
                    is_in[i] = is_in[i] or was_in
                    for place in range(count):
                        if was_in:
                            _sound(
                                other, k, X, is_forward, along(p, start, minus(q, p)),
                                along(p, shares[place], minus(q, p)), j, depths, triangles, places,
                            )  # fmt: skip
                        start, was_in = shares[place], senses[place] < 0
                    if was_in:
                        _sound(other, k, X, is_forward, along(p, start, minus(q, p)), q, j, depths, triangles, places)
                    is_in[m] = is_in[m] or was_in
                elif not is_first and count == 0:
                    is_in[i], is_in[m], changes = True, True, True
                    _sound(other, k, X, is_forward, p, q, j, depths, triangles, places)


@uncounted
def _sound_centres(owner, other, k, X, is_forward, depths, triangles, places):  # type: ignore[no-untyped-def]
    """Raise the depth of realization k to that of centres of triangles of a body that lie in the other one, deeper than edges.

    Where faces are flush, edges lie on the surface, and only what is between them is inside.
    """
    for t in range(owner.faces.shape[0]):
        a, b, c = _triangle(owner, k, t)
        p = scaled(1.0 / 3.0, along(along(a, 1.0, b), 1.0, c))
        p = move(X, p) if is_forward else move_back(X, p)
        if _is_beyond(other, p):
            continue
        depth, triangle, foot = _nearest(other, k, p, depths[k])
        if depth > depths[k] and _is_within(other, k, p):
            depths[k] = depth
            first, second = (p, foot) if is_forward else (move(X, foot), move(X, p))
            triangles[k, 0], triangles[k, 1] = (t, triangle) if is_forward else (triangle, t)
            for i in range(3):
                places[k, 0, i], places[k, 1, i] = first[i], second[i]


@compiled
def sound(A, B, poses, depths, triangles, places):  # type: ignore[no-untyped-def]
    """Write how deep bodies lie in each other at poses X_BA (n, 12) of realizations that interfere.

    The depth is that of the deepest of some places, on edges and in the middle of triangles of one body, below the surface of
    the other.

    depths      (n,) [mm]
    triangles   (n, 2): of A and of B, the triangle nearest to that place, or on which it lies; -1 minus an edge
    places      (n, 2, 3) [mm], in the frame of B: of A and of B, the place on the edge and the nearest one on the surface
    """
    shares, senses = np.empty(MAX_PASSES), np.empty(MAX_PASSES, dtype=np.int64)
    for k in range(poses.shape[0]):
        depths[k], triangles[k, :], places[k] = 0.0, 0, 0.0
        X = poses[k]
        _sound_edges(A, B, k, X, True, np.zeros(A.vertices.shape[0], dtype=np.bool_), shares, senses, depths, triangles, places)
        _sound_edges(
            B, A, k, X, False, np.zeros(B.vertices.shape[0], dtype=np.bool_), shares, senses, depths, triangles, places
        )
        _sound_centres(A, B, k, X, True, depths, triangles, places)
        _sound_centres(B, A, k, X, False, depths, triangles, places)


@inlined_uncounted
def _add(vectors, count, v):  # type: ignore[no-untyped-def]
    """Add a vector to `count` others if there is room, and return how many there are."""
    if count < vectors.shape[0]:
        vectors[count, 0], vectors[count, 1], vectors[count, 2] = v
        return count + 1
    return count


@uncounted
def _collect(owner, other, k, X, is_forward, region, counts, normals, crossing):  # type: ignore[no-untyped-def]  # noqa: PLR0912
    """Add what edges of a body say of the common region: its corners on them, and normals of triangles that they pass.

    All are in the frame of B. `counts` (3,) are those of points in `region`, of `normals` and of edges in `crossing`.
    """
    node_count, inner = other.next.size, other.next.size // 2
    counts[2] = 0
    for j in range(owner.edges.shape[0]):
        p, q = _corner(owner, k, owner.edges[j, 0]), _corner(owner, k, owner.edges[j, 1])
        p, q = (move(X, p), move(X, q)) if is_forward else (move_back(X, p), move_back(X, q))
        least, last, first_sense, last_sense, node = np.inf, -np.inf, 0, 0, 0
        while node < node_count:
            boxes = other.boxes
            is_off = False
            for i in range(3):
                is_off = is_off or boxes[node, i] > max(p[i], q[i]) or boxes[node, 3 + i] < min(p[i], q[i])
            if is_off:
                node = other.next[node]
                continue
            if node < inner:
                node = 2 * node + 1
                continue
            for m in range(LEAF):
                triangle = other.triangles[node - inner, m]
                if triangle < 0:
                    break
                share, sense = _share(other, k, triangle, p, q)
                if sense != 0:
                    a, b, c = _triangle(other, k, triangle)
                    place, n = along(p, share, minus(q, p)), cross(minus(b, a), minus(c, a))
                    n = scaled(1.0 / math.sqrt(dot(n, n)), n)
                    place, n = (place, n) if is_forward else (move(X, place), scaled(-1.0, turn(X, n)))
                    counts[0], counts[1] = _add(region, counts[0], place), _add(normals, counts[1], n)
                    if share < least:
                        least, first_sense = share, sense
                    if share > last:
                        last, last_sense = share, sense
            node = other.next[node]
        if last_sense != 0:
            if first_sense > 0:
                counts[0] = _add(region, counts[0], p if is_forward else move(X, p))
            if last_sense < 0:
                counts[0] = _add(region, counts[0], q if is_forward else move(X, q))
            if counts[2] < crossing.size:
                crossing[counts[2]], counts[2] = j, counts[2] + 1


@uncounted
def _add_common_normals(A, B, k, X, first, second, normals, count):  # type: ignore[no-untyped-def]
    """Add the common normals of edges of A and of B, from B to A, where both bodies are convex; return how many there are."""
    for i in first:
        d = turn(X, minus(_corner(A, k, A.edges[i, 1]), _corner(A, k, A.edges[i, 0])))
        from_A = turn(X, row(A.outward, i))
        for j in second:
            e = minus(_corner(B, k, B.edges[j, 1]), _corner(B, k, B.edges[j, 0]))
            n = cross(d, e)
            length = math.sqrt(dot(n, n))
            if length > MIN_SINE * math.sqrt(dot(d, d) * dot(e, e)):
                n = scaled((1.0 if dot(n, row(B.outward, j)) > 0.0 else -1.0) / length, n)
                if dot(n, from_A) < 0.0:
                    count = _add(normals, count, n)
    return count


@compiled
def ways_out(A, B, poses, inset, places, feet, normals, widths):  # type: ignore[no-untyped-def]
    """Write how bodies that interfere at poses X_BA (n, 12) part: along n, by the width of what they share.

    The corners of the region that both bodies share lie on their edges. Of the normals of facets that edges pass, and of
    crossing edges, the one counts along which this region is narrowest. Its lowest point is held above its highest one.

    inset         [mm] by which both surfaces together lie inside the bodies
    places, feet  (n, 3) [mm]: the lowest point, on A, and the highest one, on B, in the frames of these bodies
    normals       (n, 3), from B to A, in the frame of B
    widths        (n,) [mm]; 0 where no edge passes a surface
    """
    region, candidates = np.empty((MAX_POINTS, 3)), np.empty((MAX_NORMALS, 3))
    counts, first = np.zeros(3, dtype=np.int64), np.empty(MAX_CROSSING, dtype=np.int64)
    second = np.empty(MAX_CROSSING, dtype=np.int64)
    for k in range(poses.shape[0]):
        X = poses[k]
        counts[:], widths[k] = 0, 0.0
        _collect(A, B, k, X, True, region, counts, candidates, first)
        edges_of_A = counts[2]
        _collect(B, A, k, X, False, region, counts, candidates, second)
        count = _add_common_normals(A, B, k, X, first[:edges_of_A], second[: counts[2]], candidates, counts[1])
        best, least = 0, np.inf
        for m in range(count):
            low, high = np.inf, -np.inf
            for j in range(counts[0]):
                level = dot(row(candidates, m), row(region, j))
                low, high = min(low, level), max(high, level)
            if high - low < least:
                best, least = m, high - low
        if not least < np.inf:
            continue
        n, lowest, highest = row(candidates, best), 0, 0
        for j in range(counts[0]):
            lowest = j if dot(n, row(region, j)) < dot(n, row(region, lowest)) else lowest
            highest = j if dot(n, row(region, j)) > dot(n, row(region, highest)) else highest
        place, foot = move_back(X, along(row(region, lowest), -inset, n)), row(region, highest)
        widths[k] = least + inset
        for i in range(3):
            places[k, i], feet[k, i], normals[k, i] = place[i], foot[i], n[i]


@uncounted
def _distance_of_boxes(boxes, node, low, high):  # type: ignore[no-untyped-def]
    """Return the squared distance between the box of a node and a box."""
    square = 0.0
    for i in range(3):
        away = max(boxes[node, i] - high[i], 0.0, low[i] - boxes[node, 3 + i])
        square += away * away
    return square


@compiled
def distances(lower, upper, boxes, successors, result):  # type: ignore[no-untyped-def]
    """Write how far (n,) [mm] boxes from `lower` to `upper` (n, 3) are from the nearest leaf of a BoxTree."""
    inner = successors.size // 2
    for k in range(lower.shape[0]):
        low, high, least, node = row(lower, k), row(upper, k), np.inf, 0
        while node < successors.size:
            square = _distance_of_boxes(boxes, node, low, high)
            if not square < least:
                node = successors[node]
            elif node < inner:
                node = 2 * node + 1
            else:
                least, node = square, successors[node]
        result[k] = math.sqrt(least)


@compiled
def near_facets(lower, upper, tree, around, facet_of, reach, is_written, starts, near, reaches):  # type: ignore[no-untyped-def]
    """Count, or write, the facets that are no farther than `reach` [mm] from each box from `lower` to `upper` (n, 3).

    tree        triangles, boxes, next of a BoxTree
    around      (t, 6) [mm]: boxes of the triangles
    facet_of    (t,): the facet of each triangle
    starts      (n + 1,): written if not `is_written`, else read; near, reaches (m,): the facets, and their distances [mm]
    """
    triangles, boxes, successors = tree
    inner, least = successors.size // 2, np.full(facet_of.max() + 1, np.inf)
    found = np.empty(least.size, dtype=np.int64)
    for k in range(lower.shape[0]):
        low, high, node, count = row(lower, k), row(upper, k), 0, 0
        while node < successors.size:
            square = _distance_of_boxes(boxes, node, low, high)
            if square > reach * reach:
                node = successors[node]
            elif node < inner:
                node = 2 * node + 1
            else:
                for j in range(LEAF):
                    triangle = triangles[node - inner, j]
                    if triangle >= 0:
                        facet, distance = facet_of[triangle], math.sqrt(_distance_of_boxes(around, triangle, low, high))
                        if distance <= reach:
                            if least[facet] == np.inf:
                                found[count], count = facet, count + 1
                            least[facet] = min(least[facet], distance)
                node = successors[node]
        if is_written:
            order = np.argsort(least[found[:count]])
            for j in range(count):
                facet = found[order[j]]
                near[starts[k] + j], reaches[starts[k] + j] = facet, least[facet]
        else:
            starts[k + 1] = starts[k] + count
        least[found[:count]] = np.inf
