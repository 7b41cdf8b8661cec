"""Compiled choice among the candidates that touch: which of them count, and which are written."""

import numpy as np

from tolcontact.compiled import uncounted
from tolcontact.geometry.kernel import CORNER_ON_FACET, EDGE_ON_EDGE
from tolcontact.geometry.vector_kernel import dot, minus, row


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
