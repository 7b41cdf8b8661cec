"""Compiled search for the separating axis of two convex bodies: the largest gap, or the smallest penetration."""

import math
from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled, inlined_uncounted, uncounted
from tolcontact.geometry.kernel import ORIGIN, PARALLEL
from tolcontact.geometry.vector_kernel import along, cross, dot, minus, move, move_back, row, row_of, scaled, turn, turn_back


class Convex(NamedTuple):
    """A convex body.

    vertices   (v, 3) [mm]
    normals    (f, 3): outward unit normals of its planes
    heights    (f,) [mm]: largest height of the body along these normals
    edges      (e, 2, 3) [mm]: the ends of its edges
    into       (e, 2, 3): unit vectors across each edge into the two planes that meet there
    """

    vertices: np.ndarray
    normals: np.ndarray
    heights: np.ndarray
    edges: np.ndarray
    into: np.ndarray


@inlined_uncounted
def _lowest(vertices, n):  # type: ignore[no-untyped-def]
    """Return the vertex that is lowest along n, and its height."""
    best, lowest = 0, np.inf
    for j in range(vertices.shape[0]):
        height = dot(n, row(vertices, j))
        if height < lowest:
            best, lowest = j, height
    return best, lowest


@inlined_uncounted
def _common_normal(d, e, into_A, into_B, i, j):  # type: ignore[no-untyped-def]
    """Return the common normal of two edges, from B to A, and its length; 0 if another axis separates the bodies better there.

    The length is |d x e|. At each edge, both adjacent planes lie on the same side of the normal.
    """
    c = cross(d, e)
    length = math.sqrt(dot(c, c))
    first, second = dot(c, row_of(into_B, j, 0)), dot(c, row_of(into_B, j, 1))
    third, fourth = dot(c, row_of(into_A, i, 0)), dot(c, row_of(into_A, i, 1))
    if first <= 0.0 and second <= 0.0 and third >= 0.0 and fourth >= 0.0:
        return c, length
    if first >= 0.0 and second >= 0.0 and third <= 0.0 and fourth <= 0.0:
        return scaled(-1.0, c), length
    return ORIGIN, 0.0


@inlined_uncounted
def _nearest_shares(w, d, e):  # type: ignore[no-untyped-def]
    """Return the shares of edges x + s d and y + u e, with w = y - x, at which they are nearest to each other."""
    dd, ee, de, dw, ew = dot(d, d), dot(e, e), dot(d, e), dot(d, w), dot(e, w)
    s = min(max((dw * ee - ew * de) / (dd * ee - de * de), 0.0), 1.0)
    u = min(max((s * de - ew) / ee, 0.0), 1.0)
    return s, u


@uncounted
def _across_edges(B, lines, into, largest_gap):  # type: ignore[no-untyped-def]
    """Return the pair of edges whose common normal gives the largest gap, and that gap; -1 if it is not above `largest_gap`."""
    best = -1, -1
    for i in range(lines.shape[0]):
        start, d = row_of(lines, i, 0), row_of(lines, i, 1)
        length_d = math.sqrt(dot(d, d))
        for j in range(B.edges.shape[0]):
            q = row_of(B.edges, j, 0)
            e = minus(row_of(B.edges, j, 1), q)
            c, length = _common_normal(d, e, into, B.into, i, j)
            if length > PARALLEL * length_d * math.sqrt(dot(e, e)):
                gap = dot(c, minus(start, q)) / length
                if gap > largest_gap:
                    best, largest_gap = (i, j), gap
    return best, largest_gap


@uncounted
def _place_edges(A, X, lines, into):  # type: ignore[no-untyped-def]
    """Write starts and vectors of the edges of A in `lines` (e, 2, 3), and its `into` (e, 2, 3), in the frame of B."""
    for i in range(A.edges.shape[0]):
        start = row_of(A.edges, i, 0)
        lines[i, 0, 0], lines[i, 0, 1], lines[i, 0, 2] = move(X, start)
        lines[i, 1, 0], lines[i, 1, 1], lines[i, 1, 2] = turn(X, minus(row_of(A.edges, i, 1), start))
        for f in range(2):
            into[i, f, 0], into[i, f, 1], into[i, f, 2] = turn(X, row_of(A.into, i, f))


@compiled
def part(A, B, poses, edges, gaps, points, projections, normals):  # type: ignore[no-untyped-def]
    """Write the separating axes of convex bodies at poses X_BA (n, 12): the axes with the largest gap.

    An axis is a normal of a plane of either body, or a common normal of two edges. Bodies that penetrate each other have a
    negative gap along every axis.

    edges           (n,): e i + j if the axis is the common normal of edge i of A and edge j of the e edges of B, else -1
    gaps            (n,) [mm]: gap along the axis
    points, projections    (n, 3) [mm]: points on A and on B, in the frames of these bodies
    normals         (n, 3): the axis from B to A, in the frame of B
    """
    lines, into = np.empty(A.edges.shape), np.empty(A.into.shape)
    for k in range(poses.shape[0]):
        X = poses[k]
        _place_edges(A, X, lines, into)
        gap, point, projection, n = -np.inf, ORIGIN, ORIGIN, ORIGIN
        for f in range(B.normals.shape[0]):
            normal = row(B.normals, f)
            vertex, height = _lowest(A.vertices, turn_back(X, normal))
            height += dot(normal, (X[9], X[10], X[11])) - B.heights[f]
            if height > gap:
                corner = row(A.vertices, vertex)
                gap, n, point, projection = height, normal, corner, along(move(X, corner), -height, normal)
        for f in range(A.normals.shape[0]):
            down = row(A.normals, f)
            normal = turn(X, scaled(-1.0, down))
            # The highest vertex of B along the normal is the lowest one along its opposite.
            vertex, height = _lowest(B.vertices, scaled(-1.0, normal))
            height += dot(normal, (X[9], X[10], X[11])) - A.heights[f]
            if height > gap:
                corner = row(B.vertices, vertex)
                gap, n, projection, point = height, normal, corner, move_back(X, along(corner, height, normal))
        (i, j), gap = _across_edges(B, lines, into, gap)
        edges[k] = i * B.edges.shape[0] + j if i >= 0 else -1
        if i >= 0:
            x, d, y = row_of(lines, i, 0), row_of(lines, i, 1), row_of(B.edges, j, 0)
            e = minus(row_of(B.edges, j, 1), y)
            c, length = _common_normal(d, e, into, B.into, i, j)
            n = scaled(1.0 / length, c)
            s, u = _nearest_shares(minus(y, x), d, e)
            point, projection = move_back(X, along(x, s, d)), along(y, u, e)
        gaps[k] = gap
        for i in range(3):
            points[k, i], projections[k, i], normals[k, i] = point[i], projection[i], n[i]


@compiled
def cross_edges(A, B, poses, edges, axes, gaps, points, projections, normals):  # type: ignore[no-untyped-def]
    """Write the gaps of pairs of `edges` (n, k), see `part`, along their common normals nearest to the `axes` (n, 3).

    gaps                     (n, k) [mm], infinite for -1 and where edges do not cross as seen along their common normal
    points, projections, normals    (n, k, 3), as in `part`
    """
    gaps[:] = np.inf
    for k in range(poses.shape[0]):
        X = poses[k]
        for m in range(edges.shape[1]):
            if edges[k, m] < 0:
                continue
            i, j = edges[k, m] // B.edges.shape[0], edges[k, m] % B.edges.shape[0]
            x, y = move(X, row_of(A.edges, i, 0)), row_of(B.edges, j, 0)
            d, e = minus(move(X, row_of(A.edges, i, 1)), x), minus(row_of(B.edges, j, 1), y)
            c, w = cross(d, e), minus(y, x)
            square = dot(c, c)
            s, u = dot(cross(w, e), c), dot(cross(w, d), c)
            if not (square > PARALLEL * PARALLEL * dot(d, d) * dot(e, e) and 0.0 <= s <= square and 0.0 <= u <= square):
                continue
            n = scaled((1.0 if dot(c, row(axes, k)) > 0.0 else -1.0) / math.sqrt(square), c)
            gaps[k, m] = -dot(n, w)
            point, projection = move_back(X, along(x, s / square, d)), along(y, u / square, e)
            for f in range(3):
                points[k, m, f], projections[k, m, f], normals[k, m, f] = point[f], projection[f], n[f]
