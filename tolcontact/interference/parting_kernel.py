"""Compiled search for the direction of the least motion that separates bodies that interfere."""

import math
from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled, uncounted
from tolcontact.geometry.vector_kernel import along, cross, dot, minus, move, move_back, row, scaled, turn
from tolcontact.interference.kernel import LEAF, corners_of, crossing, deviate, misses, vertex

MIN_SINE = 1e-3  # of the angle between edges that have a common normal
MAX_POINTS = 512  # of the common region of two bodies
MAX_NORMALS = 256
MAX_CROSSING = 12  # edges of each body whose common normals are compared
SAME_SHARE = 1e-9  # of an edge: two triangles that it passes within this distance share the edge where it passes
NO_VERTEX = -1


class Region(NamedTuple):
    """Corners of the region that two bodies share, in the frame of B: where edges pass facets, and vertices in the other body.

    points     (p, 3) [mm]
    normals    (p, 3): of the facet that an edge passes, from B to A; 0 at vertices
    facets     (p, 4): two facets of A and two of B, twice the same inside a facet; -1 at vertices
    vertices   (p,): the vertex of A, or -2 minus the vertex of B; NO_VERTEX where an edge passes a facet
    edges      (p,): the edge that passes the facet, with the sign of `vertices`
    shares     (p,) of that edge
    senses     (p,): -1 inwards, 1 outwards, 0 at vertices
    parents    (p,): another corner of the same connected part of the region, or the corner itself
    """

    points: np.ndarray
    normals: np.ndarray
    facets: np.ndarray
    vertices: np.ndarray
    edges: np.ndarray
    shares: np.ndarray
    senses: np.ndarray
    parents: np.ndarray


@uncounted
def _add(region, count, point, normal, number, share, sense):  # type: ignore[no-untyped-def]
    """Add a corner if there is room: where an edge passes a facet, or, without a sense, a vertex; return how many there are."""
    if count == region.points.shape[0]:
        return count
    for i in range(3):
        region.points[count, i], region.normals[count, i] = point[i], normal[i]
    region.facets[count, :] = -1
    region.vertices[count], region.edges[count] = (number, NO_VERTEX) if sense == 0 else (NO_VERTEX, number)
    region.shares[count], region.senses[count], region.parents[count] = share, sense, count
    return count + 1


@uncounted
def _root(parents, j):  # type: ignore[no-untyped-def]
    """Return the corner that represents all of the same connected part."""
    while parents[j] != j:
        parents[j] = parents[parents[j]]
        j = parents[j]
    return j


@uncounted
def _join(parents, i, j):  # type: ignore[no-untyped-def]
    """Join the connected parts of two corners."""
    i, j = _root(parents, i), _root(parents, j)
    parents[max(i, j)] = min(i, j)


@uncounted
def _join_along(region, first, count, p, q, vertices):  # type: ignore[no-untyped-def]
    """Join the corners of an edge from p to q, those from `first` on, where it runs inside the other body.

    Ends that are inside are added, as `vertices`. Returns how many corners there are.
    """
    last = count
    for j in range(first, last):
        nearest = -np.inf
        for other in range(first, last):
            ahead = (region.shares[other] - region.shares[j]) * region.senses[j]
            if region.senses[other] == -region.senses[j] and ahead < SAME_SHARE:
                nearest = max(nearest, ahead)
        if nearest == -np.inf:
            end, number = (p, vertices[0]) if region.senses[j] > 0 else (q, vertices[1])
            added = _add(region, count, end, (0.0, 0.0, 0.0), number, 0.0, 0)
            if added > count:
                _join(region.parents, j, count)
            count = added
        for other in range(first, last):
            ahead = (region.shares[other] - region.shares[j]) * region.senses[j]
            if region.senses[other] == -region.senses[j] and nearest - SAME_SHARE <= ahead < SAME_SHARE:
                _join(region.parents, j, other)
    return count


@uncounted
def _collect(owner, target, X, is_forward, region, count):  # type: ignore[no-untyped-def]
    """Add corners of the common region on the edges of a body; return how many there are."""
    node_count, inner = target.next.size, target.next.size // 2
    for j in range(owner.edges.shape[0]):
        p, q = vertex(owner, owner.edges[j, 0]), vertex(owner, owner.edges[j, 1])
        p, q = (move(X, p), move(X, q)) if is_forward else (move_back(X, p), move_back(X, q))
        first, node = count, 0
        while node < node_count:
            if misses(target.boxes, node, p, q):
                node = target.next[node]
                continue
            if node < inner:
                node = 2 * node + 1
                continue
            for m in range(LEAF):
                triangle = target.triangles[node - inner, m]
                if triangle < 0:
                    break
                share, sense = crossing(target, triangle, p, q)
                if sense != 0:
                    a, b, c = corners_of(target, triangle)
                    place, n = along(p, share, minus(q, p)), cross(minus(b, a), minus(c, a))
                    n = scaled(1.0 / math.sqrt(dot(n, n)), n)
                    place, n = (place, n) if is_forward else (move(X, place), scaled(-1.0, turn(X, n)))
                    added = _add(region, count, place, n, j if is_forward else -2 - j, share, sense)
                    for side in range(2 if added > count else 0):
                        region.facets[count, side if is_forward else 2 + side] = owner.sides[j, side]
                        region.facets[count, 2 + side if is_forward else side] = target.facet_of[triangle]
                    count = added
            node = target.next[node]
        p, q = (p, q) if is_forward else (move(X, p), move(X, q))
        i, m = owner.edges[j, 0], owner.edges[j, 1]
        count = _join_along(region, first, count, p, q, (i, m) if is_forward else (-2 - i, -2 - m))
    return count


@uncounted
def _join_parts(region, count):  # type: ignore[no-untyped-def]
    """Join corners at the same vertex, or on the same facet of A and of B: an edge of the region may lie between them.

    So separate regions between the same two facets count as one.
    """
    facets = region.facets
    for i in range(count):
        for j in range(i):
            is_same = region.vertices[i] != NO_VERTEX and region.vertices[i] == region.vertices[j]
            if not is_same and facets[i, 0] >= 0 and facets[j, 0] >= 0:
                of_A = facets[i, 0] == facets[j, 0] or facets[i, 0] == facets[j, 1]
                of_A = of_A or facets[i, 1] == facets[j, 0] or facets[i, 1] == facets[j, 1]
                of_B = facets[i, 2] == facets[j, 2] or facets[i, 2] == facets[j, 3]
                of_B = of_B or facets[i, 3] == facets[j, 2] or facets[i, 3] == facets[j, 3]
                is_same = of_A and of_B
            if is_same:
                _join(region.parents, i, j)


@uncounted
def _normals_of_part(A, B, X, region, count, part, edges_A, edges_B, normals):  # type: ignore[no-untyped-def]
    """Write the normals along which a connected part of the region may be narrowest; return how many there are.

    They are the normals of facets that edges pass, and the common normals of edges of A and of B where both bodies are convex;
    some of the passing edges are written.
    """
    found = 0
    count_A, count_B = 0, 0
    for j in range(count):
        if region.senses[j] == 0 or _root(region.parents, j) != part:
            continue
        if found < normals.shape[0]:
            for i in range(3):
                normals[found, i] = region.normals[j, i]
            found += 1
        edge = region.edges[j]
        if edge >= 0 and count_A < edges_A.size and (count_A == 0 or edges_A[count_A - 1] != edge):
            edges_A[count_A], count_A = edge, count_A + 1
        if edge < 0 and count_B < edges_B.size and (count_B == 0 or edges_B[count_B - 1] != -2 - edge):
            edges_B[count_B], count_B = -2 - edge, count_B + 1
    for i in edges_A[:count_A]:
        d = turn(X, minus(vertex(A, A.edges[i, 1]), vertex(A, A.edges[i, 0])))
        from_A = turn(X, row(A.outward, i))
        for j in edges_B[:count_B]:
            e = minus(vertex(B, B.edges[j, 1]), vertex(B, B.edges[j, 0]))
            n = cross(d, e)
            length = math.sqrt(dot(n, n))
            if length > MIN_SINE * math.sqrt(dot(d, d) * dot(e, e)) and found < normals.shape[0]:
                n = scaled((1.0 if dot(n, row(B.outward, j)) > 0.0 else -1.0) / length, n)
                if dot(n, from_A) < 0.0:
                    normals[found, 0], normals[found, 1], normals[found, 2] = n
                    found += 1
    return found


@uncounted
def _narrowest(region, count, part, normals):  # type: ignore[no-untyped-def]
    """Return the normal along which a part of the region is narrowest, its width, and its ends along the normal."""
    best, least, lowest, highest = 0, np.inf, 0, 0
    for m in range(normals.shape[0]):
        low, high, bottom, top = np.inf, -np.inf, 0, 0
        for j in range(count):
            if _root(region.parents, j) == part:
                level = dot(row(normals, m), row(region.points, j))
                low, bottom = (level, j) if level < low else (low, bottom)
                high, top = (level, j) if level > high else (high, top)
        if high - low < least:
            best, least, lowest, highest = m, high - low, bottom, top
    return best, least, lowest, highest


@compiled
def ways_out(A, B, poses, inset, directions, places, feet, normals, widths):  # type: ignore[no-untyped-def]
    """Write how bodies that interfere at poses X_BA (n, 12) separate: along n, by the width of their common region.

    The corners of the region that both bodies share lie on their edges. Of the normals of facets that edges pass, and of
    crossing edges, the one counts along which this region is narrowest. Its lowest point is held above its highest one. Of
    several connected parts of the region the widest counts, or the part whose normal is closest to a given direction.

    inset         [mm]: sum of the depths of both surfaces inside the bodies
    directions    (n, 3): the given ones, 0 for none
    places, feet  (n, 3) [mm]: the lowest point, on A, and the highest one, on B, in the frames of these bodies
    normals       (n, 3), from B to A, in the frame of B
    widths        (n,) [mm]; 0 where no edge passes a surface
    """
    numbers = (np.empty(MAX_POINTS, dtype=np.int64), np.empty(MAX_POINTS, dtype=np.int64))
    region = Region(
        np.empty((MAX_POINTS, 3)), np.empty((MAX_POINTS, 3)), np.empty((MAX_POINTS, 4), dtype=np.int64), *numbers,
        np.empty(MAX_POINTS), np.empty(MAX_POINTS, dtype=np.int64), np.empty(MAX_POINTS, dtype=np.int64),
    )  # fmt: skip
    candidates = np.empty((MAX_NORMALS, 3))
    edges = np.empty(MAX_CROSSING, dtype=np.int64), np.empty(MAX_CROSSING, dtype=np.int64)
    for k in range(poses.shape[0]):
        X, direction, best_score, widths[k] = poses[k], row(directions, k), -np.inf, 0.0
        deviate(A, k)
        deviate(B, k)
        count = _collect(B, A, X, False, region, _collect(A, B, X, True, region, 0))
        _join_parts(region, count)
        for part in range(count):
            if _root(region.parents, part) != part:
                continue
            found = _normals_of_part(A, B, X, region, count, part, *edges, candidates)
            if found == 0:
                continue
            best, width, lowest, highest = _narrowest(region, count, part, candidates[:found])
            n = row(candidates, best)
            score = width if dot(direction, direction) == 0.0 else dot(n, direction)
            if score > best_score:
                best_score, widths[k] = score, width + inset
                place, foot = move_back(X, along(row(region.points, lowest), -inset, n)), row(region.points, highest)
                for i in range(3):
                    places[k, i], feet[k, i], normals[k, i] = place[i], foot[i], n[i]
