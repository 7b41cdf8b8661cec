"""Compiled gaps where two bodies can touch, at corners on facets and edges across edges, and the choice among these points."""

import math

import numpy as np

from tolcontact.compiled import inlined_uncounted, uncounted
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
NEARLY_PARALLEL = 1e-3  # sine of the angle between edges, below which their common normal does not give their distance


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


@uncounted
def keep_shallowest(candidates, touching, gaps, least):  # type: ignore[no-untyped-def]
    """Drop all but the nearest facet of a corner that is behind several: it leaves through that one. Facing planes are kept.

    A corner may be behind several facets by no more than `least` [mm].
    """
    best, owner_of_best = -1, -1
    for s in touching:
        kind = candidates.kinds[s]
        if kind == EDGE_ON_EDGE or not gaps[s] < -least:
            continue
        owner = 2 * candidates.firsts[s] if kind == CORNER_ON_FACET else 2 * candidates.seconds[s] + 1
        if owner != owner_of_best:
            best, owner_of_best = s, owner
        elif gaps[s] <= gaps[best]:
            if candidates.planes[s] < 0 and gaps[s] < gaps[best]:
                gaps[s] = np.inf
        else:
            if candidates.planes[best] < 0:
                gaps[best] = np.inf
            best = s


@uncounted
def drop_beyond_ridges(candidates, touching, gaps, tie):  # type: ignore[no-untyped-def]
    """Drop a facet that a corner touches, with a gap of at most `tie` [mm], if it touches a facing plane beyond a convex edge.

    A corner is outside if it is in front of one of the two: held in front of both, it could not leave along either.
    """
    first, owner_of_first = 0, -1
    for k in range(touching.size):
        s = touching[k]
        kind = candidates.kinds[s]
        if kind == EDGE_ON_EDGE:
            return
        owner = 2 * candidates.firsts[s] if kind == CORNER_ON_FACET else 2 * candidates.seconds[s] + 1
        if owner != owner_of_first:
            first, owner_of_first = k, owner
        if candidates.planes[s] >= 0 and -tie <= gaps[s] <= tie:
            for other in touching[first:k]:
                if candidates.ridges[other] == candidates.planes[s] and gaps[other] <= tie:
                    gaps[other] = np.inf


@uncounted
def is_near(candidates, s, projection, projections, touching, gaps, distance):  # type: ignore[no-untyped-def]
    """Return whether a contact point of facing planes is within `distance` of another one at which they touch."""
    for neighbour in touching:
        if candidates.planes[neighbour] == candidates.planes[s] and gaps[neighbour] < np.inf:
            difference = minus(row(projections, neighbour), projection)
            if dot(difference, difference) <= distance * distance:
                return True
    return False


@uncounted
def least(touching, gaps):  # type: ignore[no-untyped-def]
    """Return the smallest gap of candidates that touch; infinite if there are none."""
    least = np.inf
    for s in touching:
        least = min(least, gaps[s])
    return least


@uncounted
def choose(touching, gaps, projections, retained, directions, is_chosen, labels):  # type: ignore[no-untyped-def]
    """Write the labels (p,) of relevant points: retained ones, those with the smallest gaps, and the outermost; -1 for none.

    Return the number of points.
    """
    number, count = 0, labels.size - (directions.shape[0] if touching.size > labels.size else 0)
    for s in touching:
        is_chosen[s] = gaps[s] == np.inf
    for s in retained:
        if s >= 0 and gaps[s] < np.inf and not is_chosen[s]:
            labels[number], is_chosen[s], number = s, True, number + 1
    while number < count:
        shallowest, gap = -1, np.inf
        for s in touching:
            if gaps[s] < gap and not is_chosen[s]:
                shallowest, gap = s, gaps[s]
        if shallowest < 0:
            labels[number:] = -1
            return number
        labels[number], is_chosen[shallowest], number = shallowest, True, number + 1
    for direction in directions:
        outermost, farthest = -1, -np.inf
        for s in touching:
            if gaps[s] < np.inf:
                distance = dot(direction, row(projections, s))
                if distance > farthest:
                    outermost, farthest = s, distance
        if outermost >= 0 and not is_chosen[outermost]:
            labels[number], is_chosen[outermost], number = outermost, True, number + 1
    labels[number:] = -1
    return number


@inlined_uncounted
def _nominal_height(A, B, candidates, s, X, n, point, projection):  # type: ignore[no-untyped-def]
    """Return the nominal height of candidate s: the height of its point over its projection along n, or along R'n.

    Two edges may have shifted along each other: their height is the distance of their lines.
    """
    arm = minus(point, projection)
    if candidates.kinds[s] == EDGE_ON_EDGE:
        start_A, start_B = row_of(A.edges, candidates.firsts[s], 0), row_of(B.edges, candidates.seconds[s], 0)
        d = minus(row_of(A.edges, candidates.firsts[s], 1), start_A)
        e = minus(row_of(B.edges, candidates.seconds[s], 1), start_B)
        arm = minus(start_A, start_B)
        arm = along(arm, -dot(arm, e) / dot(e, e), e)
        across = along(d, -dot(d, e) / dot(e, e), e)
        if dot(across, across) > NEARLY_PARALLEL * NEARLY_PARALLEL * dot(d, d):
            arm = along(arm, -dot(arm, across) / dot(across, across), across)
    return max(dot(n, arm), dot(turn_back(X, n), arm))  # whichever body the normal belongs to


@uncounted
def drop_passed(A, B, candidates, passed, X, touching, gaps, all_points, is_held):  # type: ignore[no-untyped-def]
    """Drop points that are nominally deeper than `passed` [mm] and have a held corner: the body penetrated at that corner.

    The corners of a point are the corner itself, or the ends of both edges. `is_held` (corner,) is false before and after, for
    the corners of the moving body followed by the corners of the reference body.
    """
    points, projections, normals = all_points
    count = A.vertices.shape[0]
    for is_first in (True, False):
        for s in touching:
            is_edge = candidates.kinds[s] == EDGE_ON_EDGE
            owner = candidates.firsts[s] if candidates.kinds[s] == CORNER_ON_FACET else count + candidates.seconds[s]
            height = _nominal_height(A, B, candidates, s, X, row(normals, s), row(points, s), row(projections, s))
            has_passed = height < -passed
            if is_first and not is_edge and not has_passed and gaps[s] <= INSIDE:
                is_held[owner] = True
            elif not is_first and has_passed and candidates.planes[s] < 0 and gaps[s] < -INSIDE:
                if is_edge:
                    for end in range(2):
                        is_at_A = is_held[A.ends[candidates.firsts[s], end]]
                        if is_at_A or is_held[count + B.ends[candidates.seconds[s], end]]:
                            gaps[s] = np.inf
                elif is_held[owner]:
                    gaps[s] = np.inf
    is_held[:] = False
