"""Compiled search for the points at which two bodies touch, among all candidates, at given relative poses."""

import math
from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled, inlined_uncounted, uncounted
from tolcontact.geometry.choice_kernel import choose, drop_beyond_ridges, is_near, keep_shallowest, least
from tolcontact.geometry.kernel import (
    CORNER_ON_FACET,
    EDGE_ON_EDGE,
    FACET_ON_CORNER,
    IN_PLANE,
    INSIDE,
    MAX_TILT_SINE,
    NOWHERE,
    TINY,
    corner_on_facet,
    edge_on_edge,
    facet_on_corner,
)
from tolcontact.geometry.passed_kernel import drop_passed
from tolcontact.geometry.vector_kernel import cross, dot, first_from, is_within, minus, move, move_back, row, row_of, turn

LEVEL = MAX_TILT_SINE - 2 * IN_PLANE  # sine of the angle between planes: edges in one of them rise no further above the other
MAX_SHEAR = 1.8  # lateral shift of a corner's projection per unit height, where planes face each other
ZERO = (0.0, 0.0, 0.0)
EVERYWHERE = (-np.inf, -np.inf, np.inf, np.inf)


class Candidates(NamedTuple):
    """The points at which two bodies can touch (see Meeting), grouped by the corner or edge of one body.

    The candidates of a corner or edge and one facing plane, or no plane, are a run; runs begin at `runs` (run + 1,). From
    `middles` (run,) on they are sorted by the first value of their boxes, which are no wider than `widths` (run,) [mm]. Runs
    at holes do not matter before bodies move by `clearances` (run,) [mm] from their nominal poses; this is 0 for other runs.
    `ridges` (candidate,) are the facing planes beyond a convex edge of the facet that a corner may touch, -1 for none.
    `ball` (4,) [mm] is the centre and radius of a ball around the moving corners.
    `boxes` (candidate, 4) [mm] are the smallest and largest coordinates of the facets or the edge that a corner or an edge may
    touch in a facing plane, along the vectors in `frames` (facing planes, body, 2, 3). `segments` (row, 4) are the outlines of
    facing planes in these coordinates, in bands that begin at `bands` (band + 1,) (see is_within). The bands of a plane of the
    moving and of the reference body begin at `outlines` (2 planes + 1,), and extend over `spans` (2 planes, 2) [mm].
    """

    kinds: np.ndarray
    firsts: np.ndarray
    seconds: np.ndarray
    planes: np.ndarray
    ridges: np.ndarray
    facing: np.ndarray
    runs: np.ndarray
    middles: np.ndarray
    widths: np.ndarray
    clearances: np.ndarray
    ball: np.ndarray
    boxes: np.ndarray
    frames: np.ndarray
    segments: np.ndarray
    bands: np.ndarray
    outlines: np.ndarray
    spans: np.ndarray


@inlined_uncounted
def _turn_square(X):  # type: ignore[no-untyped-def]
    """Return |R - I|^2 at a pose X (12,)."""
    square = 0.0
    for i in range(9):
        square += (X[i] - (1.0 if i % 4 == 0 else 0.0)) ** 2
    return square


@compiled
def cover(poses, corners, travel, turn, covered):  # type: ignore[no-untyped-def]
    """Write whether corners (v, 3) travel by at most `travel` [mm], and rotate by at most `turn` [rad], at X_RM (n, 12)."""
    largest = 8 * math.sin(turn / 2) ** 2 if turn < math.pi else np.inf
    for k in range(poses.shape[0]):
        X = poses[k]
        covered[k] = not _turn_square(X) > largest
        for j in range(corners.shape[0]):
            corner = row(corners, j)
            motion = minus(move(X, corner), corner)
            if dot(motion, motion) > travel * travel:
                covered[k] = False


@inlined_uncounted
def _is_over_plane(candidates, plane, body, x, slack):  # type: ignore[no-untyped-def]
    """Return whether x, in the frame of a body (0: moving, 1: reference), lies over one of two facing planes."""
    outline, frames = 2 * plane + body, candidates.frames
    coordinate_1 = frames[plane, body, 0, 0] * x[0] + frames[plane, body, 0, 1] * x[1] + frames[plane, body, 0, 2] * x[2]
    coordinate_2 = frames[plane, body, 1, 0] * x[0] + frames[plane, body, 1, 1] * x[1] + frames[plane, body, 1, 2] * x[2]
    first, last, span = candidates.outlines[outline], candidates.outlines[outline + 1], candidates.spans[outline]
    return is_within(candidates.segments, candidates.bands, first, last, span, coordinate_1, coordinate_2, slack)


@inlined_uncounted
def _owner(A, B, candidates, s, X):  # type: ignore[no-untyped-def]
    """Return the start and the vector of the corner or edge of candidate s at a pose; a corner has no vector.

    They are in the frame of the body that it may touch.
    """
    kind, index_A, index_B = candidates.kinds[s], candidates.firsts[s], candidates.seconds[s]
    if kind == CORNER_ON_FACET:
        return move(X, row(A.vertices, index_A)), ZERO
    if kind == FACET_ON_CORNER:
        return move_back(X, row(B.vertices, index_B)), ZERO
    start, end = row_of(A.edges, index_A, 0), row_of(A.edges, index_A, 1)
    return move(X, start), turn(X, minus(end, start))


@inlined_uncounted
def _place(A, B, candidates, s, slack, reach, X, owner, level):  # type: ignore[no-untyped-def]
    """Return gap, point, projection and normal of candidate s of an owner, which may lie `slack` [mm] outside edges."""
    start, vector = owner
    kind, index_A, index_B, plane = candidates.kinds[s], candidates.firsts[s], candidates.seconds[s], candidates.planes[s]
    is_level = plane >= 0 and level[plane]
    flat = 0 if plane < 0 else candidates.facing[plane, 0 if kind == CORNER_ON_FACET else 1]
    if kind == EDGE_ON_EDGE:
        return edge_on_edge(A, B, index_A, index_B, flat, plane, slack, reach, X, start, vector)
    if kind == CORNER_ON_FACET:
        results = corner_on_facet(A, B, index_A, index_B, flat, plane, is_level, slack, reach, X, start)
        is_over = plane < 0 or results[0] == np.inf or _is_over_plane(candidates, plane, 1, start, slack)
    else:
        results = facet_on_corner(A, B, index_A, index_B, flat, plane, is_level, slack, reach, X, start)
        is_over = plane < 0 or results[0] == np.inf or _is_over_plane(candidates, plane, 0, results[1], slack)
    return results if is_over else NOWHERE


@inlined_uncounted
def _write(results, s, gaps, points, projections, normals):  # type: ignore[no-untyped-def]
    """Write gap, point, projection and normal of candidate s."""
    gaps[s] = results[0]
    for vectors, vector in ((points, results[1]), (projections, results[2]), (normals, results[3])):
        vectors[s, 0], vectors[s, 1], vectors[s, 2] = vector


@inlined_uncounted
def _range(A, candidates, s, owner, slack):  # type: ignore[no-untyped-def]
    """Return the smallest and largest coordinates of the owner of candidate s in the plane that faces it."""
    start, vector = owner
    kind, plane = candidates.kinds[s], candidates.planes[s]
    body = 0 if kind == FACET_ON_CORNER else 1
    axis_1, axis_2 = row_of(candidates.frames[plane], body, 0), row_of(candidates.frames[plane], body, 1)
    if kind == EDGE_ON_EDGE:
        low, high, low_2, high_2 = dot(axis_1, start), dot(axis_1, vector), dot(axis_2, start), dot(axis_2, vector)
        return (
            low + min(high, 0.0) - slack, low_2 + min(high_2, 0.0) - slack,
            low + max(high, 0.0) + slack, low_2 + max(high_2, 0.0) + slack,
        )  # fmt: skip
    shear = slack
    if kind == FACET_ON_CORNER:
        facet = candidates.facing[plane, 0]
        shear += MAX_SHEAR * abs(dot(row(A.normals, facet), minus(start, row_of(A.facets, facet, 0))))
    x_1, x_2 = dot(axis_1, start), dot(axis_2, start)
    return x_1 - shear, x_2 - shear, x_1 + shear, x_2 + shear


@inlined_uncounted
def _lowest(A, B, candidates, s, owner):  # type: ignore[no-untyped-def]
    """Return the least gap that the owner of candidate s can have to the plane that faces it."""
    start, vector = owner
    kind, plane = candidates.kinds[s], candidates.planes[s]
    flat_A, flat_B = candidates.facing[plane, 0], candidates.facing[plane, 1]
    if kind == FACET_ON_CORNER:  # the gap along the other normal is larger than this distance
        return dot(row(A.normals, flat_A), minus(start, row_of(A.facets, flat_A, 0)))
    n, foot = row(B.normals, flat_B), row_of(B.facets, flat_B, 0)
    return dot(n, minus(start, foot)) + min(dot(n, vector), 0.0)


@inlined_uncounted
def _motion(ball, X):  # type: ignore[no-untyped-def]
    """Return a bound on the motion [mm] of the points in a ball at a pose X_RM (12,) from their nominal places."""
    centre = ball[0], ball[1], ball[2]
    motion = minus(move(X, centre), centre)
    return math.sqrt(dot(motion, motion)) + math.sqrt(_turn_square(X)) * ball[3]


@uncounted
def _find_at(  # type: ignore[no-untyped-def]
    A, B, candidates, reach, margins, nearness, overhang, retained, ceiling, X, level, touching, is_held, gaps, all_points
):
    """Write gap, points and normal of the candidates that touch at one pose X_RM (12,); return how many there are.

    Retained candidates of facing planes count slightly outside their edges: near a corner of the overlap the error of the
    extended planes is small. Far from it, or where planes no longer overlap, the other body may be free.

    margins       (p + 1,) [mm]: largest distance of contact points outside edges: for retained candidates of each pair of
                  facing planes, and last for all other candidates
    nearness      in margins: largest distance of such a contact point from a point where the planes touch
    retained      (k,): indices of the retained candidates, or -1
    ceiling       [mm]: candidates of facing planes with larger gaps are left out, unless their edge reaches below it
    level         (p,): whether facing planes are level (see corner_on_facet)
    touching      (c,): indices of the candidates that touch
    is_held       (corner,), false: see drop_passed
    gaps          (c,) [mm], initially infinite
    all_points    points, projections, normals (3, c, 3): P^m, P^r, n^r of the paper
    """
    (points, projections, normals), margin, boxes = all_points, margins[-1], candidates.boxes
    count, motion = 0, _motion(candidates.ball, X)
    for run in range(candidates.widths.size):
        s, middle, end = candidates.runs[run], candidates.middles[run], candidates.runs[run + 1]
        is_flat = candidates.planes[s] >= 0
        if motion < candidates.clearances[run]:
            continue
        owner = _owner(A, B, candidates, s, X)
        if is_flat and _lowest(A, B, candidates, s, owner) > ceiling:
            continue
        low, low_2, high, high_2 = _range(A, candidates, s, owner, margin) if is_flat else EVERYWHERE
        while True:
            if s == middle:
                s = first_from(boxes, middle, end, low - candidates.widths[run])
            if s >= end or (s >= middle and boxes[s, 0] > high):
                break
            if not (boxes[s, 2] < low or boxes[s, 3] < low_2 or boxes[s, 1] > high_2):
                _write(_place(A, B, candidates, s, margin, reach, X, owner, level), s, gaps, points, projections, normals)
                if gaps[s] < np.inf:
                    touching[count], count = s, count + 1
            s += 1
    drop_passed(A, B, candidates, reach[2], X, touching[:count], gaps, all_points, is_held)
    drop_beyond_ridges(candidates, touching[:count], gaps, margin)
    keep_shallowest(candidates, touching[:count], gaps, max(INSIDE, overhang))
    strict = count
    for s in retained:
        if s >= 0 and candidates.planes[s] >= 0 and gaps[s] == np.inf:
            slack = margins[candidates.planes[s]]
            results = _place(A, B, candidates, s, slack, reach, X, _owner(A, B, candidates, s, X), level)
            if results[0] < np.inf and is_near(
                candidates, s, results[2], projections, touching[:strict], gaps, nearness * slack
            ):
                _write(results, s, gaps, points, projections, normals)
                touching[count], count = s, count + 1
    return count


@uncounted
def _sines(A, B, facing, X, sines):  # type: ignore[no-untyped-def]
    """Write sines of the angles between facing planes at a pose X_RM (12,)."""
    for j in range(facing.shape[0]):
        across = cross(turn(X, row(A.normals, facing[j, 0])), row(B.normals, facing[j, 1]))
        sines[j] = math.sqrt(dot(across, across))


@uncounted
def _find_at_each(A, B, candidates, reach, margin, error, poses, retained, ceilings, directions, results, scratch):  # type: ignore
    """Write the results of `find`: labels, gaps, points, projections and normals. Return the largest number of points."""
    level, margins, touching, is_held, is_chosen, all_gaps, all_points = scratch
    labels, gaps, points, projections, normals = results
    points_at, projections_at, normals_at = all_points
    facing, largest = candidates.facing, 0
    for k in range(poses.shape[0]):
        X = poses[k]
        _sines(A, B, facing, X, margins)
        margins[-1] = margin
        for j in range(facing.shape[0]):
            level[j] = margins[j] < LEVEL
            margins[j] = max(margin, min(error[0] / max(margins[j], TINY), error[1]))
        number, ceiling = 0, ceilings[k]
        while True:
            for s in touching[:number]:
                all_gaps[s] = np.inf
            number = _find_at(
                A, B, candidates, reach, margins, error[2], error[3], retained[k], ceiling, X, level, touching, is_held,
                all_gaps, all_points,
            )  # fmt: skip
            if ceiling == np.inf or least(touching[:number], all_gaps) <= ceiling:
                break
            ceiling = np.inf
        chosen = choose(touching[:number], all_gaps, projections_at, retained[k], directions, is_chosen, labels[k])
        largest = max(largest, chosen)
        gaps[k, chosen:] = np.inf
        for p in range(chosen):
            s = labels[k, p]
            gaps[k, p] = all_gaps[s]
            for i in range(3):
                points[k, p, i], projections[k, p, i], normals[k, p, i] = (
                    points_at[s, i],
                    projections_at[s, i],
                    normals_at[s, i],
                )
        for s in touching[:number]:
            all_gaps[s] = np.inf
    return largest


@compiled
def find(  # type: ignore[no-untyped-def]
    A, B, candidates, reach, margin, error, poses, retained, ceilings, directions, labels, gaps, points, projections, normals
):
    """Write the relevant points at which bodies can touch, at poses X_RM (n, 12), and return the largest number of points.

    First come the candidates in `retained` (n, k), then those with the smallest gaps, then the outermost in each of the
    `directions` (direction, 3). All are written if there is room for them.

    Candidates of facing planes with gaps above `ceilings` (n,) [mm] may be left out, unless all gaps are larger.

    A, B          Body, the moving and the reference one
    candidates    Candidates
    reach         (4,): the largest depth and the largest gap [mm] of a contact point; the nominal depth [mm] beyond which a
                  body must have penetrated elsewhere; the length from which the slope of a gap between rims counts
    margin        [mm]: largest distance of contact points outside edges
    error         (4,): the permitted error [mm] of facing planes outside their edges, the margin [mm] where it is permitted,
                  the distance in margins from a point where they touch, and the largest depth [mm] of a corner that counts
                  behind several facets
    labels        (n, p): indices of the candidates, -1 for none
    gaps          (n, p) [mm], infinite for none
    points, projections, normals   (n, p, 3), left unchanged for none
    """
    count = candidates.kinds.size
    scratch = (
        np.empty(candidates.facing.shape[0], dtype=np.bool_),
        np.empty(candidates.facing.shape[0] + 1), np.empty(count, dtype=np.int64),
        np.zeros(A.vertices.shape[0] + B.vertices.shape[0], dtype=np.bool_), np.zeros(count, dtype=np.bool_),
        np.full(count, np.inf), np.empty((3, count, 3)),
    )  # fmt: skip
    results = (labels, gaps, points, projections, normals)
    return _find_at_each(A, B, candidates, reach, margin, error, poses, retained, ceilings, directions, results, scratch)
