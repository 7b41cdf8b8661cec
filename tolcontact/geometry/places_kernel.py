"""Compiled search for the places at which two bodies touch, among all candidates, at given relative poses."""

import math
from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled
from tolcontact.geometry.kernel import (
    CORNER_ON_FACET,
    EDGE_ON_EDGE,
    FACET_ON_CORNER,
    INSIDE,
    TINY,
    corner_on_facet,
    edge_on_edge,
    facet_on_corner,
    pass_by,
)
from tolcontact.geometry.vector_kernel import cross, dot, inlined, is_beside, is_within, move_back, turn

MAX_SHEAR = 1.8  # by which a corner's place beside a facet changes with its height, where planes face each other


class Candidates(NamedTuple):
    """The places at which two bodies can touch (see Meeting), those of a corner or edge of one body one after the other.

    `boxes` (candidate, 4) [mm] are least and largest coordinates, in a facing plane, of the facets or the edge that a corner or
    an edge may touch there, along the vectors in `frames` (facing planes, body, 2, 3). `segments` (segment, 4) are the outlines
    of facing planes in these coordinates; those of a plane of the moving and of the reference body begin at `outlines`
    (2 planes + 1,).
    """

    kinds: np.ndarray
    firsts: np.ndarray
    seconds: np.ndarray
    planes: np.ndarray
    facing: np.ndarray
    boxes: np.ndarray
    frames: np.ndarray
    segments: np.ndarray
    outlines: np.ndarray


@compiled
def _keep_shallowest(candidates, touching, gaps):  # type: ignore[no-untyped-def]
    """Drop all but the nearest of the facets that a corner is behind: by that one it leaves. Facing planes hold all corners."""
    best, owner_of_best = -1, -1
    for s in touching:
        kind = candidates.kinds[s]
        if kind == EDGE_ON_EDGE or not gaps[s] < -INSIDE:
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


@compiled
def _bound(A, candidates, s, moved, spare, box):  # type: ignore[no-untyped-def]
    """Write the least and largest coordinates (4,) of the corner or edge of candidate s in the plane that faces it."""
    corners, lines, back = moved
    kind, first, second, plane = candidates.kinds[s], candidates.firsts[s], candidates.seconds[s], candidates.planes[s]
    frame = candidates.frames[plane, 0 if kind == FACET_ON_CORNER else 1]
    for axis in range(2):
        if kind == EDGE_ON_EDGE:
            low, along = dot(frame[axis], lines[first, 0]), dot(frame[axis], lines[first, 1])
            low, high = low + min(along, 0.0), low + max(along, 0.0)
        elif kind == CORNER_ON_FACET:
            low = high = dot(frame[axis], corners[first])
        else:
            height, facet = 0.0, candidates.facing[plane, 0]
            for i in range(3):
                height += A.normals[facet, i] * (back[second, i] - A.facets[facet, 0, i])
            low = dot(frame[axis], back[second])
            low, high = low - MAX_SHEAR * abs(height), low + MAX_SHEAR * abs(height)
        box[axis], box[2 + axis] = low - spare, high + spare


@inlined
def _is_over_plane(candidates, plane, body, x, spare):  # type: ignore[no-untyped-def]
    """Return whether x (3,), in the frame of a body (0: moving, 1: reference), lies over one of two facing planes."""
    frame, start, end = (
        candidates.frames[plane, body],
        candidates.outlines[2 * plane + body],
        candidates.outlines[2 * plane + body + 1],
    )
    return is_within(candidates.segments[start:end], dot(frame[0], x), dot(frame[1], x), spare)


@compiled
def _gap(A, B, candidates, s, spare, reach, X, moved, v, place, foot, n):  # type: ignore
    """Write place, foot and normal (3,) of candidate s, which may lie `spare` [mm] beside edges; return its gap [mm]."""
    corners, lines, back = moved
    kind, first, second, plane = candidates.kinds[s], candidates.firsts[s], candidates.seconds[s], candidates.planes[s]
    flat = 0 if plane < 0 else candidates.facing[plane, 1]
    if kind == EDGE_ON_EDGE:
        if pass_by(lines, first, B.edges, second, B.normals, flat, plane, spare):
            return np.inf
        return edge_on_edge(A, B, first, second, flat, plane, spare, reach, X, lines[first], v, place, foot, n)
    if kind == CORNER_ON_FACET:
        if plane < 0 and is_beside(B.facets, B.inward, second, corners, first, spare):
            return np.inf
        gap = corner_on_facet(A, B, first, second, plane, spare, reach, X, corners[first], v, place, foot, n)
        is_over = plane < 0 or gap == np.inf or _is_over_plane(candidates, plane, 1, corners[first], spare)
    else:
        if plane < 0 and is_beside(A.facets, A.inward, first, back, second, spare):
            return np.inf
        gap = facet_on_corner(A, B, first, second, flat, plane, spare, reach, X, v, place, foot, n)
        is_over = plane < 0 or gap == np.inf or _is_over_plane(candidates, plane, 0, place, spare)
    return gap if is_over else np.inf


@compiled
def _is_near(candidates, s, feet, touching, gaps, distance):  # type: ignore[no-untyped-def]
    """Return whether a place of facing planes is no farther than `distance` from another one at which they touch."""
    for other in touching:
        if candidates.planes[other] == candidates.planes[s] and gaps[other] < np.inf:
            away = 0.0
            for i in range(3):
                away += (feet[other, i] - feet[s, i]) ** 2
            if away <= distance * distance:
                return True
    return False


@compiled
def _find_at(A, B, candidates, reach, margins, nearness, kept, X, moved, v, touching, gaps, all_places):  # type: ignore
    """Write gap, places and normal of the candidates that touch at one pose X_RM (12,); return how many there are.

    Of facing planes, candidates that are kept count a little beside their edges: there, near a corner of the overlap, the
    planes themselves err little. Far from it, or where planes no longer overlap, another body may be free.

    margins       (p + 1,) [mm] by which places may lie beside edges: those that are kept, of each two facing planes; all others
    nearness      in margins: how far from a place where the planes touch such a place may lie
    kept          (k,): numbers of the candidates that are kept, or -1
    moved         corners (v, 3), and starts and vectors of edges (e, 2, 3), of the moving body in the reference frame, and
                  corners of the reference body in the moving frame
    v             scratch (5, 3)
    touching      (c,): numbers of the candidates that touch
    gaps          (c,) [mm], infinite before
    all_places    places, feet, normals (3, c, 3): P^m, P^r, n^r of the paper
    """
    (places, feet, normals), margin, box = all_places, margins[-1], np.empty(4)
    count = 0
    bounded, bounded_plane, boxes = -1, -1, candidates.boxes  # the corner or edge, and the plane, that the box is of
    for s in range(candidates.kinds.size):
        kind, plane = candidates.kinds[s], candidates.planes[s]
        if plane >= 0:
            owner = 3 * (candidates.seconds[s] if kind == FACET_ON_CORNER else candidates.firsts[s]) + kind
            if owner != bounded or plane != bounded_plane:
                _bound(A, candidates, s, moved, margin, box)
                bounded, bounded_plane = owner, plane
            if box[2] < boxes[s, 0] or box[3] < boxes[s, 1] or box[0] > boxes[s, 2] or box[1] > boxes[s, 3]:
                continue
        gaps[s] = _gap(A, B, candidates, s, margin, reach, X, moved, v, places[s], feet[s], normals[s])
        if gaps[s] < np.inf:
            touching[count], count = s, count + 1
    _keep_shallowest(candidates, touching[:count], gaps)
    strict = count
    for s in kept:
        if s >= 0 and candidates.planes[s] >= 0 and gaps[s] == np.inf:
            spare = margins[candidates.planes[s]]
            gap = _gap(A, B, candidates, s, spare, reach, X, moved, v, places[s], feet[s], normals[s])
            if gap < np.inf and _is_near(candidates, s, feet, touching[:strict], gaps, nearness * spare):
                gaps[s], touching[count], count = gap, s, count + 1
    return count


@compiled
def _choose(touching, gaps, feet, kept, directions, taken, labels):  # type: ignore[no-untyped-def]
    """Write the labels (p,) of places that may matter: those kept, those of the least gaps, and the outermost; -1 for none."""
    number = 0
    for s in touching:
        taken[s] = gaps[s] == np.inf
    for s in kept:
        if s >= 0 and gaps[s] < np.inf and not taken[s]:
            labels[number], taken[s], number = s, True, number + 1
    while number < labels.size - directions.shape[0]:
        least, gap = -1, np.inf
        for s in touching:
            if gaps[s] < gap and not taken[s]:
                least, gap = s, gaps[s]
        if least < 0:
            break
        labels[number], taken[least], number = least, True, number + 1
    for direction in directions:
        outermost, farthest = -1, -np.inf
        for s in touching:
            if gaps[s] < np.inf:
                along = dot(direction, feet[s])
                if along > farthest:
                    outermost, farthest = s, along
        if outermost >= 0 and not taken[outermost]:
            labels[number], taken[outermost], number = outermost, True, number + 1
    labels[number:] = -1


@compiled
def _move(A, B, facing, X, v, corners, lines, back, sines):  # type: ignore[no-untyped-def]
    """Write what moves at a pose X_RM (12,): see `moved` in _find_at; and sines of the angles between facing planes."""
    for j in range(corners.shape[0]):
        turn(X, A.vertices[j], corners[j])
        corners[j] += X[9:]
    for j in range(lines.shape[0]):
        turn(X, A.edges[j, 0], lines[j, 0])
        turn(X, A.edges[j, 1] - A.edges[j, 0], lines[j, 1])
        lines[j, 0] += X[9:]
    for j in range(back.shape[0]):
        move_back(X, B.vertices[j], v[0], back[j])
    for j in range(facing.shape[0]):
        turn(X, A.normals[facing[j, 0]], v[0])
        cross(v[0], B.normals[facing[j, 1]], v[1])
        sines[j] = math.sqrt(dot(v[1], v[1]))


@compiled
def find(A, B, candidates, reach, margin, error, poses, kept, directions, labels, gaps, places, feet, normals):  # type: ignore
    """Write the places at which bodies can touch, at poses X_RM (n, 12): of all candidates those that may matter.

    These are first those in `kept` (n, k), then the ones with the least gaps, then the outermost in each of the `directions`
    (direction, 3). All are written if there is room for them.

    A, B          Body, the moving and the reference one
    candidates    Candidates
    reach         (2,) [mm]: the largest depth, and the largest gap, that a place may have
    margin        [mm] by which places may lie beside edges
    error         (3,) [mm] that facing planes may make beside their edges, the margin in which they may make it, and how many
                  margins away from a place where they touch
    labels        (n, p): numbers of the candidates, -1 where there is none
    gaps          (n, p) [mm], infinite where there is none
    places, feet, normals   (n, p, 3)
    """
    count, room, facing = candidates.kinds.size, labels.shape[1], candidates.facing
    corners, lines, v, back = np.empty(A.vertices.shape), np.empty(A.edges.shape), np.empty((5, 3)), np.empty(B.vertices.shape)
    all_gaps, all_places = np.full(count, np.inf), np.zeros((3, count, 3))
    taken, touching, margins = np.zeros(count, dtype=np.bool_), np.empty(count, dtype=np.int64), np.empty(facing.shape[0] + 1)
    places_at, feet_at, normals_at = all_places
    for k in range(poses.shape[0]):
        X = poses[k]
        _move(A, B, facing, X, v, corners, lines, back, margins)
        margins[-1] = margin
        for j in range(facing.shape[0]):
            margins[j] = max(margin, min(error[0] / max(margins[j], TINY), error[1]))
        moved = (corners, lines, back)
        number = _find_at(A, B, candidates, reach, margins, error[2], kept[k], X, moved, v, touching, all_gaps, all_places)
        if count <= room:
            labels[k] = -1
            labels[k, :count] = np.arange(count)
        else:
            _choose(touching[:number], all_gaps, feet_at, kept[k], directions, taken, labels[k])
        for p in range(room):
            s = labels[k, p]
            gaps[k, p] = np.inf if s < 0 else all_gaps[s]
            if s >= 0:
                places[k, p], feet[k, p], normals[k, p] = places_at[s], feet_at[s], normals_at[s]
        for s in touching[:number]:
            all_gaps[s] = np.inf
