"""Compiled choice of the points that take the slots of the QP."""

import numpy as np

from tolcontact.compiled import uncounted


@uncounted
def _has(points, k, count, point):  # type: ignore[no-untyped-def]
    """Return whether a point is among the first `count` points of row k."""
    has = False
    for s in range(count):
        has = has or points[k, s] == point
    return has


@uncounted
def extend(points, filled, reactions, candidates, depth, tolerance, fills, extended):  # type: ignore[no-untyped-def]
    """Write slots that hold the points in use and then the deepest candidates; and which rows have new ones that are inside.

    points, filled, reactions   (n, slot): the slots before
    candidates   (n, c): indices of points
    depth        (n, c) [mm]: candidates deeper than the tolerance are inside; -inf means no candidate
    fills        whether candidates outside follow those inside
    extended     points, filled, reactions (n, slot) after; grows (n,)
    """
    new_points, new_filled, new_reactions, grows = extended
    room = points.shape[1]
    for k in range(points.shape[0]):
        used = 0
        for s in range(room):
            if filled[k, s]:
                new_points[k, used], new_reactions[k, used], used = points[k, s], reactions[k, s], used + 1
        count, grows[k] = used, False
        for c in range(candidates.shape[1]):
            point, is_inside = candidates[k, c], depth[k, c] > tolerance
            if not (is_inside or (fills and depth[k, c] > -np.inf)) or _has(new_points, k, used, point):
                continue
            # A point that already has a row is inside by the solver's residual; another round would not change that.
            grows[k] = grows[k] or (is_inside and not (fills and _has(points, k, room, point)))
            if count < room:
                count += 1
            elif count == used or depth[k, c] <= new_reactions[k, count - 1]:
                continue
            s = count - 1
            # The reactions of new points are their depths until all are sorted.
            while s > used and new_reactions[k, s - 1] < depth[k, c]:
                new_points[k, s], new_reactions[k, s], s = new_points[k, s - 1], new_reactions[k, s - 1], s - 1
            new_points[k, s], new_reactions[k, s] = point, depth[k, c]
        for s in range(room):
            new_filled[k, s] = s < count
            if s >= used:
                new_reactions[k, s] = 0.0
            if s >= count:
                new_points[k, s] = -1 if fills else points[k, s]


@uncounted
def keep(points, filled, multipliers, share, most, kept):  # type: ignore[no-untyped-def]
    """Write slots that hold only active points, the largest multipliers first, at most `most` points.

    points, filled, multipliers   (n, slot): the slots before
    share        of the largest multiplier: points with less are not active
    kept         points, filled, reactions (n, slot) after
    """
    kept_points, kept_filled, reactions = kept
    for k in range(points.shape[0]):
        for slot in range(points.shape[1]):
            value, s = multipliers[k, slot] if filled[k, slot] else 0.0, slot
            while s > 0 and reactions[k, s - 1] < value:
                kept_points[k, s], reactions[k, s], s = kept_points[k, s - 1], reactions[k, s - 1], s - 1
            kept_points[k, s], reactions[k, s] = points[k, slot], value
        least = share * max(reactions[k, 0], share)
        for s in range(points.shape[1]):
            kept_filled[k, s] = s < most and reactions[k, s] > least
            if not kept_filled[k, s]:
                reactions[k, s] = 0.0
