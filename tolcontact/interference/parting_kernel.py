"""Compiled directions in which bodies that interfere part with the least motion."""

import math

import numpy as np

from tolcontact.compiled import compiled, inlined_uncounted, uncounted
from tolcontact.geometry.vector_kernel import along, cross, dot, minus, move, move_back, row, scaled, turn
from tolcontact.interference.kernel import LEAF, corners_of, crossing, vertex

MIN_SINE = 1e-3  # of the angle between edges that have a common normal
MAX_POINTS = 512  # of the common region of two bodies
MAX_NORMALS = 256
MAX_CROSSING = 12  # edges of each body whose common normals are compared


@inlined_uncounted
def _add(vectors, count, v):  # type: ignore[no-untyped-def]
    """Add a vector to `count` others if there is room, and return how many there are."""
    if count < vectors.shape[0]:
        vectors[count, 0], vectors[count, 1], vectors[count, 2] = v
        return count + 1
    return count


@uncounted
def _collect(owner, target, X, is_forward, region, counts, normals, crossing_edges):  # type: ignore[no-untyped-def]  # noqa: PLR0912
    """Add what edges of a body say of the common region: its corners on them, and normals of triangles that they pass.

    All are in the frame of B. `counts` (3,) are those of points in `region`, of `normals` and of edges in `crossing_edges`.
    """
    node_count, inner = target.next.size, target.next.size // 2
    counts[2] = 0
    for j in range(owner.edges.shape[0]):
        p, q = vertex(owner, owner.edges[j, 0]), vertex(owner, owner.edges[j, 1])
        p, q = (move(X, p), move(X, q)) if is_forward else (move_back(X, p), move_back(X, q))
        entry, exit_share, entry_sense, exit_sense, node = np.inf, -np.inf, 0, 0, 0
        while node < node_count:
            boxes = target.boxes
            is_off = False
            for i in range(3):
                is_off = is_off or boxes[node, i] > max(p[i], q[i]) or boxes[node, 3 + i] < min(p[i], q[i])
            if is_off:
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
                    counts[0], counts[1] = _add(region, counts[0], place), _add(normals, counts[1], n)
                    if share < entry:
                        entry, entry_sense = share, sense
                    if share > exit_share:
                        exit_share, exit_sense = share, sense
            node = target.next[node]
        if exit_sense != 0:
            if entry_sense > 0:
                counts[0] = _add(region, counts[0], p if is_forward else move(X, p))
            if exit_sense < 0:
                counts[0] = _add(region, counts[0], q if is_forward else move(X, q))
            if counts[2] < crossing_edges.size:
                crossing_edges[counts[2]], counts[2] = j, counts[2] + 1


@uncounted
def _add_common_normals(A, B, X, edges_A, edges_B, normals, count):  # type: ignore[no-untyped-def]
    """Add the common normals of edges of A and of B, from B to A, where both bodies are convex; return how many there are."""
    for i in edges_A:
        d = turn(X, minus(vertex(A, A.edges[i, 1]), vertex(A, A.edges[i, 0])))
        from_A = turn(X, row(A.outward, i))
        for j in edges_B:
            e = minus(vertex(B, B.edges[j, 1]), vertex(B, B.edges[j, 0]))
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
    counts, crossing_A = np.zeros(3, dtype=np.int64), np.empty(MAX_CROSSING, dtype=np.int64)
    crossing_B = np.empty(MAX_CROSSING, dtype=np.int64)
    for k in range(poses.shape[0]):
        X = poses[k]
        counts[:], widths[k] = 0, 0.0
        _collect(A, B, X, True, region, counts, candidates, crossing_A)
        edges_of_A = counts[2]
        _collect(B, A, X, False, region, counts, candidates, crossing_B)
        count = _add_common_normals(A, B, X, crossing_A[:edges_of_A], crossing_B[: counts[2]], candidates, counts[1])
        best, min_width = 0, np.inf
        for m in range(count):
            low, high = np.inf, -np.inf
            for j in range(counts[0]):
                level = dot(row(candidates, m), row(region, j))
                low, high = min(low, level), max(high, level)
            if high - low < min_width:
                best, min_width = m, high - low
        if not min_width < np.inf:
            continue
        n, lowest, highest = row(candidates, best), 0, 0
        for j in range(counts[0]):
            lowest = j if dot(n, row(region, j)) < dot(n, row(region, lowest)) else lowest
            highest = j if dot(n, row(region, j)) > dot(n, row(region, highest)) else highest
        place, foot = move_back(X, along(row(region, lowest), -inset, n)), row(region, highest)
        widths[k] = min_width + inset
        for i in range(3):
            places[k, i], feet[k, i], normals[k, i] = place[i], foot[i], n[i]
