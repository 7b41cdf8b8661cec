"""Compiled gaps at the points where two bodies can touch: corners on facets, and edges across edges."""

import math

import numpy as np

from tolcontact.compiled import inlined_uncounted
from tolcontact.geometry.vector_kernel import (
    along,
    cross,
    dot,
    is_inside,
    is_over,
    minus,
    move_back,
    row,
    row_of,
    scaled,
    turn,
    turn_back,
)  # fmt: skip

CORNER_ON_FACET, FACET_ON_CORNER, EDGE_ON_EDGE = 0, 1, 2  # the moving body comes first
MARGIN = 1e-9  # of the size: largest distance outside an edge at which a contact point counts
MAX_TILT_SINE = 0.2  # largest sine of the tilt of a normal out of the cone of a corner or an edge
MIN_CROSSING = 1e-3  # rad: edges of facing planes that cross at a smaller angle meet at their corners
IN_PLANE = 1e-6  # sine of the largest angle between a plane and its edges
PARALLEL = 1e-6  # rad: edges at a smaller angle have no common normal
MAX_SLOPE = 1.5  # length up to which the slope of a gap between rims counts; beyond, they are nearly parallel
INSIDE = 1e-9  # mm: contact points that are no deeper count as touching
TINY = 1e-300
ORIGIN = (0.0, 0.0, 0.0)
NOWHERE = (np.inf, ORIGIN, ORIGIN, ORIGIN)  # gap, point, projection and normal of elements that do not meet


@inlined_uncounted
def _tilt_sine(body, corner, n, normal):  # type: ignore[no-untyped-def]
    """Return the sine of the largest angle of edges at a corner above the plane across n.

    Only edges in the plane of a `normal` count, or all edges if it is 0: where a wall rises from a plane, the plane ends at the
    wall, and its corner there bounds what another plane shares with it, although the wall's edge rises above both.
    """
    tilt_sine = 0.0
    for j in range(body.cones[corner], body.cones[corner + 1]):
        if abs(dot(row(body.directions, j), normal)) < IN_PLANE:
            tilt_sine = max(tilt_sine, dot(row(body.directions, j), n))
    return tilt_sine


@inlined_uncounted
def corner_on_facet(A, B, index_A, index_B, flat, plane, is_level, spare, reach, X, x):  # type: ignore[no-untyped-def]
    """Return gap, point, projection and normal of a corner, now at x, of the moving body on a facet of the reference body.

    flat       the facet of the moving body in the plane that faces the reference body's
    is_level   whether these planes are so parallel that no edge in them rises too far above the other plane
    """
    n = row(B.normals, index_B)
    height = dot(n, minus(x, row_of(B.facets, index_B, 0)))
    if not (-reach[0] <= height <= reach[1]) or (plane < 0 and not is_over(B.facets, B.inward, index_B, x, spare)):
        return NOWHERE
    own = ORIGIN if plane < 0 else row(A.normals, flat)
    if not is_level and _tilt_sine(A, index_A, scaled(-1.0, turn_back(X, n)), own) > MAX_TILT_SINE:
        return NOWHERE
    if plane < 0 and height < -INSIDE and not is_inside(B.triangles, x):
        return NOWHERE
    return height, row(A.vertices, index_A), along(x, -height, n), n


@inlined_uncounted
def facet_on_corner(A, B, index_A, index_B, flat, plane, is_level, spare, reach, X, y):  # type: ignore[no-untyped-def]
    """Return gap, point, projection and normal of a facet of the moving body on a corner of the reference body.

    flat   the facet of the reference body along whose normal facing planes touch
    y      the corner in the frame of the moving body
    """
    down = row(A.normals, index_A)
    if plane < 0:
        d = scaled(-1.0, down)
        n, own = turn(X, d), ORIGIN
    else:
        n = own = row(B.normals, flat)
        d = turn_back(X, n)
    fall = dot(d, down)
    height = -dot(down, minus(y, row_of(A.facets, index_A, 0))) / fall
    if not (fall < -0.5 and -reach[0] <= height <= reach[1]):
        return NOWHERE
    place = along(y, height, d)
    if plane < 0 and not is_over(A.facets, A.inward, index_A, place, spare):
        return NOWHERE
    if not is_level and _tilt_sine(B, index_B, n, own) > MAX_TILT_SINE:
        return NOWHERE
    if plane < 0 and height < -INSIDE and not is_inside(A.triangles, y):
        return NOWHERE
    return height, place, row(B.vertices, index_B), n


@inlined_uncounted
def _rises(A, B, index_A, index_B, X, n):  # type: ignore[no-untyped-def]
    """Return the tilts of n and of -n towards the facets at two edges, as a normal from the reference to the moving body.

    Both are sines of the largest angle.
    """
    y = turn_back(X, n)
    rises, falls = -1.0, -1.0
    for f in range(2):
        on_B, on_A = dot(n, row_of(B.into, index_B, f)), dot(y, row_of(A.into, index_A, f))
        rises, falls = max(rises, on_B, -on_A), max(falls, -on_B, on_A)
    return rises, falls


@inlined_uncounted
def _inner(x, share, d, n, height, normals, edge):  # type: ignore[no-untyped-def]
    """Return the point on the edge x + s d that is equally deep below both facets at another edge.

    It lies inside the other body if x is below that edge by -height along n. Where facets meet sharply, x may lie outside.
    """
    normal_1, normal_2 = row_of(normals, edge, 0), row_of(normals, edge, 1)
    rise, run = dot(n, normal_1) - dot(n, normal_2), dot(d, normal_1) - dot(d, normal_2)
    s = 0.0 if run == 0 else -height * rise / run
    return along(x, min(max(s, -share), 1 - share), d)


@inlined_uncounted
def _is_past(share, edge, spare):  # type: ignore[no-untyped-def]
    """Return whether a share of an edge lies beyond its ends by more than `spare` [mm]."""
    beyond = max(-share, share - 1)
    return beyond > 0 and beyond * beyond * dot(edge, edge) > spare * spare


@inlined_uncounted
def edge_on_edge(A, B, index_A, index_B, flat, plane, spare, reach, X, x, d):  # type: ignore[no-untyped-def]
    """Return gap, point, projection and normal of an edge of the moving body across one of the reference body.

    The edge, now at x + s d, meets q + u e where s = (q - x) x e . m / c . m and u = (q - x) x d . m / c . m, with c = d x e,
    seen along m: their common normal, or the normal of the reference plane; then the gap's slope is c / c . m. It counts, and
    not the normal, where it is longer than reach[3].
    """
    q = row_of(B.edges, index_B, 0)
    e, w = minus(row_of(B.edges, index_B, 1), q), minus(q, x)
    c = cross(d, e)
    m = c if plane < 0 else row(B.normals, flat)
    crossing = dot(c, m)
    s, u = dot(cross(w, e), m) / crossing, dot(cross(w, d), m) / crossing
    if _is_past(s, d, spare) or _is_past(u, e, spare):
        return NOWHERE
    length, lengths = math.sqrt(dot(c, c)), math.sqrt(dot(d, d) * dot(e, e))
    if plane < 0:
        m, crossing = scaled(1 / max(length, TINY), c), length
    if not abs(crossing) > (PARALLEL if plane < 0 else MIN_CROSSING) * lengths:
        return NOWHERE
    if plane < 0:
        rises, falls = _rises(A, B, index_A, index_B, X, m)
        if min(rises, falls) > MAX_TILT_SINE:
            return NOWHERE
        if falls < rises:
            m = scaled(-1.0, m)
    y, projection = along(x, s, d), along(q, u, e)
    height = dot(minus(y, projection), m)
    if not (-reach[0] <= height <= reach[1]):
        return NOWHERE
    if plane < 0 and height < -INSIDE:
        back, up, under = turn_back(X, e), turn_back(X, scaled(-1.0, m)), move_back(X, projection)
        if not (
            is_inside(B.triangles, _inner(y, s, d, m, height, B.edge_normals, index_B))
            and is_inside(A.triangles, _inner(under, u, back, up, height, A.edge_normals, index_A))
        ):
            return NOWHERE
    is_slanted = plane >= 0 and reach[3] * abs(crossing) < length < MAX_SLOPE * abs(crossing)
    return height, move_back(X, y), projection, scaled(1 / crossing, c) if is_slanted else m
