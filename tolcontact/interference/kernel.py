"""Compiled test whether closed bodies interfere: edges of one that pass triangles of the other, and how deep they do."""

import math
from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled, inlined_uncounted, uncounted
from tolcontact.geometry.vector_kernel import along, cross, dot, minus, move, move_back, row, scaled, turn

LEAF = 4
MIN_SINE = 1e-3  # of the angle between edges that have a common normal
SAMPLES = 4  # of a piece of an edge inside the other body
MAX_PASSES = 64  # of one edge
RAY = (1.0, 0.01307, 0.00713)  # a direction that few edges have, and in which few boxes are passed
MAX_POINTS = 512  # of the common region of two bodies
MAX_NORMALS = 256
MAX_CROSSING = 12  # edges of each body whose common normals are compared


class Side(NamedTuple):
    """A body of a pair.

    vertices    (n or 1, v, 3) [mm]: of each realization, or of all of them
    faces       (t, 3)
    edges       (e, 2), those nominally nearest to the other body first
    outward     (e, 3): sums of the outward normals of the facets that meet at each edge
    distances   (e,) [mm]: bounds from below of their nominal distances from it
    triangles, boxes, next   its BoxTree
    spare       [mm] by which vertices may lie outside of the boxes
    bounds      (8, 3) [mm]: corners of a box that holds the body
    witnesses   (c,): a vertex of each connected component, nominally far from the surface of the other body
    far         (c,) [mm]: bounds from below of that distance
    is_in       (c,): whether that vertex lies nominally in the other body
    """

    vertices: np.ndarray
    faces: np.ndarray
    edges: np.ndarray
    outward: np.ndarray
    distances: np.ndarray
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
    i = 0 if side.vertices.shape[0] == 1 else k
    return side.vertices[i, number, 0], side.vertices[i, number, 1], side.vertices[i, number, 2]


@inlined_uncounted
def _share(p, q, a, b, c):  # type: ignore[no-untyped-def]
    """Return the share of the segment from p to q at which it passes a triangle, and its sense: -1 inwards, 1 outwards, 0 none.

    Places on the edges of the triangle count, so that none gets through between two triangles.
    """
    n = cross(minus(b, a), minus(c, a))
    start, end = dot(n, minus(p, a)), dot(n, minus(q, a))
    if start * end > 0.0 or start == end:
        return 0.0, 0
    d, u, v, w = minus(q, p), minus(a, p), minus(b, p), minus(c, p)
    first, second, third = dot(d, cross(u, v)), dot(d, cross(v, w)), dot(d, cross(w, u))
    is_through = (first >= 0.0 and second >= 0.0 and third >= 0.0) or (first <= 0.0 and second <= 0.0 and third <= 0.0)
    return start / (start - end), 0 if not is_through else (-1 if end < start else 1)


@uncounted
def _passes(side, k, p, q, shares, senses):  # type: ignore[no-untyped-def]
    """Write at which shares, in order, and in which senses the segment from p to q passes the surface; return how often."""
    spare, count, node, inner = side.spare, 0, 0, side.next.size // 2
    low_x, low_y, low_z = min(p[0], q[0]) - spare, min(p[1], q[1]) - spare, min(p[2], q[2]) - spare
    high_x, high_y, high_z = max(p[0], q[0]) + spare, max(p[1], q[1]) + spare, max(p[2], q[2]) + spare
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
            a, b = _corner(side, k, side.faces[triangle, 0]), _corner(side, k, side.faces[triangle, 1])
            share, sense = _share(p, q, a, b, _corner(side, k, side.faces[triangle, 2]))
            if sense != 0 and count < shares.size:
                place = count
                while place > 0 and shares[place - 1] > share:
                    shares[place], senses[place], place = shares[place - 1], senses[place - 1], place - 1
                shares[place], senses[place], count = share, sense, count + 1
        node = side.next[node]
    return count


@uncounted
def _near_count(side, motion):  # type: ignore[no-untyped-def]
    """Return how many of the edges may reach the other body if that moves by no more than `motion` [mm]."""
    low, high = 0, side.distances.size
    while low < high:
        middle = (low + high) // 2
        if side.distances[middle] <= motion:
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
        a = minus(_corner(side, k, side.faces[t, 0]), p)
        b = minus(_corner(side, k, side.faces[t, 1]), p)
        c = minus(_corner(side, k, side.faces[t, 2]), p)
        length_a, length_b, length_c = math.sqrt(dot(a, a)), math.sqrt(dot(b, b)), math.sqrt(dot(c, c))
        near = length_a * length_b * length_c + dot(a, b) * length_c + dot(b, c) * length_a + dot(c, a) * length_b
        total += math.atan2(dot(a, cross(b, c)), near)
    return total > math.pi


@uncounted
def _seems_within(side, k, p, shares, senses):  # type: ignore[no-untyped-def]
    """Return whether a ray from p leaves a body where it first passes the surface; a ray along an edge may be wrong."""
    boxes = side.boxes
    reach = 2.0 * (boxes[0, 3] - boxes[0, 0] + boxes[0, 4] - boxes[0, 1] + boxes[0, 5] - boxes[0, 2] + side.spare)
    return _passes(side, k, p, along(p, reach, RAY), shares, senses) > 0 and senses[0] > 0


@inlined_uncounted
def _is_beyond(side, p):  # type: ignore[no-untyped-def]
    """Return whether p lies outside of the box of a body."""
    spare, boxes = side.spare, side.boxes
    return (
        p[0] < boxes[0, 0] - spare or p[1] < boxes[0, 1] - spare or p[2] < boxes[0, 2] - spare
        or p[0] > boxes[0, 3] + spare or p[1] > boxes[0, 4] + spare or p[2] > boxes[0, 5] + spare
    )  # fmt: skip


@uncounted
def motion_of(X, bounds):  # type: ignore[no-untyped-def]
    """Return how far a pose X (12,) moves any point of a box with corners `bounds` (8, 3) at most."""
    largest = 0.0
    for j in range(bounds.shape[0]):
        arm = minus(move(X, row(bounds, j)), row(bounds, j))
        largest = max(largest, dot(arm, arm))
    return math.sqrt(largest)


@compiled
def interfere(A, B, poses, found):  # type: ignore[no-untyped-def]
    """Write whether (n,) body A interferes with body B at its poses X_BA (n, 12) in the frame of B.

    It does if an edge of one passes a triangle of the other, or else if one holds a component of the other.
    """
    shares, senses = np.empty(1), np.empty(1, dtype=np.int64)
    for k in range(poses.shape[0]):
        X = poses[k]
        motion = motion_of(X, A.bounds) + 2.0 * (A.spare + B.spare)
        found[k] = False
        for j in range(_near_count(A, motion)):
            p, q = move(X, _corner(A, k, A.edges[j, 0])), move(X, _corner(A, k, A.edges[j, 1]))
            if _passes(B, k, p, q, shares, senses) > 0:
                found[k] = True
                break
        if not found[k]:
            for j in range(_near_count(B, motion)):
                p, q = move_back(X, _corner(B, k, B.edges[j, 0])), move_back(X, _corner(B, k, B.edges[j, 1]))
                if _passes(A, k, p, q, shares, senses) > 0:
                    found[k] = True
                    break
        if not found[k]:
            found[k] = _holds(A, B, k, X, True, motion) or _holds(B, A, k, X, False, motion)


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
def _near_leaf(side, k, p):  # type: ignore[no-untyped-def]
    """Return a bound from above of the squared distance of p from the surface: that from a leaf with a near box."""
    node, inner, least = 0, side.next.size // 2, np.inf
    while node < inner:
        left, right = 2 * node + 1, 2 * node + 2
        node = left if _box_distance(side.boxes, left, p) <= _box_distance(side.boxes, right, p) else right
    for j in range(LEAF):
        triangle = side.triangles[node - inner, j]
        if triangle < 0:
            break
        a, b = _corner(side, k, side.faces[triangle, 0]), _corner(side, k, side.faces[triangle, 1])
        arm = minus(p, _nearest_on_triangle(p, a, b, _corner(side, k, side.faces[triangle, 2])))
        least = min(least, dot(arm, arm))
    return least * (1.0 + 1e-12)


@uncounted
def _nearest(side, k, p, enough):  # type: ignore[no-untyped-def]
    """Return the distance of p from the surface, the triangle and the place there; any if the distance is below `enough`."""
    node, inner, best, foot, least = 0, side.next.size // 2, -1, p, np.inf
    bound = _near_leaf(side, k, p)
    while node < side.next.size:
        if math.sqrt(_box_distance(side.boxes, node, p)) - side.spare > math.sqrt(min(least, bound)):
            node = side.next[node]
            continue
        if node < inner:
            node = 2 * node + 1
            continue
        for j in range(LEAF):
            triangle = side.triangles[node - inner, j]
            if triangle < 0:
                break
            a, b = _corner(side, k, side.faces[triangle, 0]), _corner(side, k, side.faces[triangle, 1])
            place = _nearest_on_triangle(p, a, b, _corner(side, k, side.faces[triangle, 2]))
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
def _sound_edges(owner, other, k, X, is_forward, motion, is_in, shares, senses, depths, triangles, places):  # type: ignore
    """Raise the depth of realization k to that of the edges of a body in the other one; `is_in` (v,) is false before."""
    for is_first in (True, False):
        changes = True
        while changes:
            changes = False
            for j in range(_near_count(owner, motion) if is_first else owner.edges.shape[0]):
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
def _sound_centres(owner, other, k, X, is_forward, shares, senses, depths, triangles, places):  # type: ignore[no-untyped-def]
    """Raise the depth of realization k to that of centres of triangles of a body that lie in the other one, deeper than edges.

    Where faces are flush, edges lie on the surface, and only what is between them is inside.
    """
    for t in range(owner.faces.shape[0]):
        a, b, c = (
            _corner(owner, k, owner.faces[t, 0]),
            _corner(owner, k, owner.faces[t, 1]),
            _corner(owner, k, owner.faces[t, 2]),
        )
        p = scaled(1.0 / 3.0, along(along(a, 1.0, b), 1.0, c))
        p = move(X, p) if is_forward else move_back(X, p)
        if _is_beyond(other, p) or not _seems_within(other, k, p, shares, senses):
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
        motion = motion_of(X, A.bounds) + 2.0 * (A.spare + B.spare)
        in_B, in_A = np.zeros(A.vertices.shape[1], dtype=np.bool_), np.zeros(B.vertices.shape[1], dtype=np.bool_)
        _sound_edges(A, B, k, X, True, motion, in_B, shares, senses, depths, triangles, places)
        _sound_edges(B, A, k, X, False, motion, in_A, shares, senses, depths, triangles, places)
        _sound_centres(A, B, k, X, True, shares, senses, depths, triangles, places)
        _sound_centres(B, A, k, X, False, shares, senses, depths, triangles, places)


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
    spare, node_count, inner = other.spare, other.next.size, other.next.size // 2
    counts[2] = 0
    for j in range(owner.edges.shape[0]):
        p, q = _corner(owner, k, owner.edges[j, 0]), _corner(owner, k, owner.edges[j, 1])
        p, q = (move(X, p), move(X, q)) if is_forward else (move_back(X, p), move_back(X, q))
        least, last, first_sense, last_sense, node = np.inf, -np.inf, 0, 0, 0
        while node < node_count:
            boxes = other.boxes
            is_off = False
            for i in range(3):
                is_off = is_off or boxes[node, i] > max(p[i], q[i]) + spare or boxes[node, 3 + i] < min(p[i], q[i]) - spare
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
                a, b = _corner(other, k, other.faces[triangle, 0]), _corner(other, k, other.faces[triangle, 1])
                c = _corner(other, k, other.faces[triangle, 2])
                share, sense = _share(p, q, a, b, c)
                if sense != 0:
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
