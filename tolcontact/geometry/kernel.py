"""Compiled gaps of the places at which two bodies can touch: corners on facets, and edges across edges."""

import math
from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled
from tolcontact.geometry.vector_kernel import cross, dot, inlined, is_inside, is_over, move_back, turn, turn_back

CORNER_ON_FACET, FACET_ON_CORNER, EDGE_ON_EDGE = 0, 1, 2  # the moving body's part first
MARGIN = 1e-9  # of the size: places that lie no farther beside an edge still count
LEANING = 0.2  # sine of the angle by which a normal may lean out of the cone of a corner or an edge
MIN_CROSSING = 1e-3  # rad: edges of facing planes that cross at a smaller angle meet at their corners
PARALLEL = 1e-6  # rad: edges at a smaller angle have no common normal
MIN_SLANT, MAX_SLANT = 1.02, 1.5  # lengths between which the slope of a gap between rims counts, not the plane's normal
INSIDE = 1e-9  # mm: places that are no deeper touch
TINY = 1e-300


class Body(NamedTuple):
    """The parts of a polyhedron at which it can touch another body (see Polyhedron), and the triangles of its whole body."""

    vertices: np.ndarray
    cones: np.ndarray
    directions: np.ndarray
    facets: np.ndarray
    normals: np.ndarray
    inward: np.ndarray
    edges: np.ndarray
    into: np.ndarray
    edge_normals: np.ndarray
    triangles: np.ndarray


@inlined
def _leaning(body, corner, n):  # type: ignore[no-untyped-def]
    """Return the sine of the angle by which edges at a corner rise above the plane across n (3,)."""
    leaning = 0.0
    for j in range(body.cones[corner], body.cones[corner + 1]):
        leaning = max(leaning, dot(body.directions[j], n))
    return leaning


@compiled
def corner_on_facet(A, B, first, second, plane, spare, reach, X, x, v, place, foot, n):  # type: ignore[no-untyped-def]
    """Write place, foot and normal of a corner x of the moving body on a facet of the reference body; return the gap."""
    d = v[0]
    height = 0.0
    for i in range(3):
        n[i] = B.normals[second, i]
        height += n[i] * (x[i] - B.facets[second, 0, i])
    if not (-reach[0] <= height <= reach[1]):
        return np.inf
    if plane < 0 and not is_over(B.facets[second], B.inward[second], x, spare):
        return np.inf
    turn_back(X, n, d)
    for i in range(3):
        d[i] = -d[i]
        place[i], foot[i] = A.vertices[first, i], x[i] - height * n[i]
    if _leaning(A, first, d) > LEANING or (plane < 0 and height < -INSIDE and not is_inside(B.triangles, x)):
        return np.inf
    return height


@compiled
def facet_on_corner(A, B, first, second, flat, plane, spare, reach, X, v, place, foot, n):  # type: ignore[no-untyped-def]
    """Write place, foot and normal of a facet of the moving body on a corner of the reference body; return the gap.

    flat   the facet of the reference body along whose normal facing planes touch
    """
    d, y, w = v[0], v[1], v[2]
    move_back(X, B.vertices[second], w, y)
    for i in range(3):
        n[i], d[i] = B.normals[flat, i], -A.normals[first, i]
    if plane < 0:
        turn(X, d, n)
    else:
        turn_back(X, n, d)
    fall, height = dot(d, A.normals[first]), 0.0
    for i in range(3):
        height -= A.normals[first, i] * (y[i] - A.facets[first, 0, i]) / fall
    if not (fall < -0.5 and -reach[0] <= height <= reach[1]):
        return np.inf
    for i in range(3):
        place[i], foot[i] = y[i] + height * d[i], B.vertices[second, i]
    if plane < 0 and not is_over(A.facets[first], A.inward[first], place, spare):
        return np.inf
    if _leaning(B, second, n) > LEANING:
        return np.inf
    return np.inf if plane < 0 and height < -INSIDE and not is_inside(A.triangles, y) else height


@inlined
def _points_away(A, B, first, second, X, n, y):  # type: ignore[no-untyped-def]
    """Turn n (3,) from the reference body to the moving one; return the sine of its angle to the normals beside both edges."""
    turn_back(X, n, y)
    rises, falls = -1.0, -1.0
    for f in range(2):
        on_B, on_A = dot(n, B.into[second, f]), dot(y, A.into[first, f])
        rises, falls = max(rises, on_B, -on_A), max(falls, -on_B, on_A)
    if falls < rises:
        for i in range(3):
            n[i] = -n[i]
    return min(rises, falls)


@inlined
def _pass_through(x, along, d, n, height, normals, out):  # type: ignore[no-untyped-def]
    """Write the place on the edge x + s d that is equally deep below both facets beside another edge.

    It lies inside the other body if x is below that edge by -height along n. Where facets meet sharply, x may lie outside.
    """
    rise, run = dot(n, normals[0]) - dot(n, normals[1]), dot(d, normals[0]) - dot(d, normals[1])
    s = 0.0 if run == 0 else -height * rise / run
    s = min(max(s, -along), 1 - along)
    for i in range(3):
        out[i] = x[i] + s * d[i]


@compiled
def edge_on_edge(A, B, first, second, flat, plane, spare, reach, X, line, v, place, foot, n):  # type: ignore
    """Write place, foot and normal of an edge of the moving body across one of the reference body; return the gap.

    The edge at x + s d, on `line` (2, 3), meets q + u e where s = (q - x) x e . m / c . m and u = (q - x) x d . m / c . m, with
    c = d x e, seen along m: their common normal, or the normal of the reference plane; then the gap's slope is c / c . m.
    """
    x, d = line
    e, c, m, w, y = v[0], v[1], v[2], v[3], v[4]
    for i in range(3):
        e[i], w[i] = B.edges[second, 1, i] - B.edges[second, 0, i], B.edges[second, 0, i] - x[i]
    cross(d, e, c)
    length, length_d, length_e = math.sqrt(dot(c, c)), math.sqrt(dot(d, d)), math.sqrt(dot(e, e))
    for i in range(3):
        m[i] = c[i] / max(length, TINY) if plane < 0 else B.normals[flat, i]
    crossing = dot(c, m)
    if abs(crossing) <= (PARALLEL if plane < 0 else MIN_CROSSING) * length_d * length_e:
        return np.inf
    cross(w, e, y)
    along_d = dot(y, m) / crossing
    cross(w, d, y)
    along_e = dot(y, m) / crossing
    aside = max(-along_d, along_d - 1) * length_d, max(-along_e, along_e - 1) * length_e
    if max(aside) > spare or (plane < 0 and _points_away(A, B, first, second, X, m, y) > LEANING):
        return np.inf
    height, is_slanted = 0.0, plane >= 0 and MIN_SLANT * abs(crossing) < length < MAX_SLANT * abs(crossing)
    for i in range(3):
        y[i], foot[i] = x[i] + along_d * d[i], B.edges[second, 0, i] + along_e * e[i]
        height += (y[i] - foot[i]) * m[i]
        n[i] = c[i] / crossing if is_slanted else m[i]
    if not (-reach[0] <= height <= reach[1]):
        return np.inf
    move_back(X, y, w, place)
    if plane < 0 and height < -INSIDE:
        _pass_through(y, along_d, d, m, height, B.edge_normals[second], w)
        if not is_inside(B.triangles, w):
            return np.inf
        for i in range(3):
            m[i] = -m[i]
        turn_back(X, m, y)
        turn_back(X, e, c)
        move_back(X, foot, w, m)
        _pass_through(m, along_e, c, y, height, A.edge_normals[first], w)
        if not is_inside(A.triangles, w):
            return np.inf
    return height


@inlined
def pass_by(lines, first, edges, second, normals, flat, plane, spare):  # type: ignore[no-untyped-def]
    """Return whether two edges do not cross, seen along their common normal or along a facet's normal (see edge_on_edge).

    This and is_beside reject most candidates without a view of an array, which costs more than they do.
    """
    x0, x1, x2, d0, d1, d2 = (
        lines[first, 0, 0], lines[first, 0, 1], lines[first, 0, 2], lines[first, 1, 0], lines[first, 1, 1], lines[first, 1, 2],
    )  # fmt: skip
    q0, q1, q2 = edges[second, 0, 0], edges[second, 0, 1], edges[second, 0, 2]
    e0, e1, e2 = edges[second, 1, 0] - q0, edges[second, 1, 1] - q1, edges[second, 1, 2] - q2
    m0, m1, m2 = d1 * e2 - d2 * e1, d2 * e0 - d0 * e2, d0 * e1 - d1 * e0
    if plane >= 0:
        c0, c1, c2, m0, m1, m2 = m0, m1, m2, normals[flat, 0], normals[flat, 1], normals[flat, 2]
        crossing = c0 * m0 + c1 * m1 + c2 * m2
    else:
        crossing = m0 * m0 + m1 * m1 + m2 * m2
    w0, w1, w2 = q0 - x0, q1 - x1, q2 - x2
    along_d = ((w1 * e2 - w2 * e1) * m0 + (w2 * e0 - w0 * e2) * m1 + (w0 * e1 - w1 * e0) * m2) / crossing
    along_e = ((w1 * d2 - w2 * d1) * m0 + (w2 * d0 - w0 * d2) * m1 + (w0 * d1 - w1 * d0) * m2) / crossing
    beyond_d, beyond_e = max(-along_d, along_d - 1), max(-along_e, along_e - 1)
    far_d = beyond_d > 0 and beyond_d * beyond_d * (d0 * d0 + d1 * d1 + d2 * d2) > spare * spare
    return far_d or (beyond_e > 0 and beyond_e * beyond_e * (e0 * e0 + e1 * e1 + e2 * e2) > spare * spare)
