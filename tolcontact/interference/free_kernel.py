"""Compiled certificates that bodies are apart: one lies in a convex region that the surface of the other does not reach."""

from typing import NamedTuple

import numpy as np

from tolcontact.compiled import compiled, inlined_uncounted, uncounted
from tolcontact.geometry.vector_kernel import along, dot, minus, move, move_back, row, row_of, turn, turn_back
from tolcontact.interference.kernel import ROUNDED, motion_of, near_count


class Region(NamedTuple):
    """A convex region, in the frame of the outer body, and the inner body.

    The region has the points x with n . x below the level of each half-space, and a distance from the core below its level.
    The core is a segment, and its distance is taken across an axis: the region is the hollow of a bore or of a slot.

    normals     (c, 3): outward unit normals of the half-spaces
    core        (3, 3): unit vector of the axis, start of the segment and vector to its end [mm]
    starts      (c + 2,): where the bounds of each half-space, and of the core, begin; a core without bounds does not count
    bounds      (g,) [mm], the least of each constraint first, and slopes (g, k): a level is the least of bounds + slopes . d,
                with the deviations d (k,) of the outer body
    levels      (c + 1,) [mm]: the nominal ones
    steepest    (k,): the largest magnitudes of slopes
    fixed       (v, 3) [mm]: vertices of the inner body that deviations do not move, the nearest to the end of the region first
    slacks      (v,) [mm]: their nominal distances from it
    moving      (m, 3) [mm]: its other vertices
    motions     (m, j, 3) [mm]: how far unit deviations of the inner body move these
    farthest    (j,) [mm]: the largest of these motions
    box         (8, 3) [mm]: corners of a box that holds the inner body
    size        [mm]: the largest coordinate of both bodies
    is_forward  whether poses X_BA move the inner body, A, into the frame of the outer one, B, and not the other way round
    """

    normals: np.ndarray
    core: np.ndarray
    starts: np.ndarray
    bounds: np.ndarray
    slopes: np.ndarray
    levels: np.ndarray
    steepest: np.ndarray
    fixed: np.ndarray
    slacks: np.ndarray
    moving: np.ndarray
    motions: np.ndarray
    farthest: np.ndarray
    box: np.ndarray
    size: float
    is_forward: bool


@inlined_uncounted
def _sum_of_sizes(lengths, deviations, k):  # type: ignore[no-untyped-def]
    """Return how far deviations of realization k move something at most that a unit of each moves by `lengths`."""
    total = 0.0
    for i in range(lengths.size):
        total += lengths[i] * abs(deviations[k, i])
    return total


@inlined_uncounted
def _level(region, i, k, deviations, fall):  # type: ignore[no-untyped-def]
    """Return the level of constraint i in realization k, where no bound falls by more than `fall`."""
    level = np.inf
    for j in range(region.starts[i], region.starts[i + 1]):
        bound = region.bounds[j]
        if bound - fall >= level:
            break
        for m in range(region.slopes.shape[1]):
            bound += region.slopes[j, m] * deviations[k, m]
        level = min(level, bound)
    return level


@inlined_uncounted
def _is_below(n, level, vertices, count, motions, columns, k, deviations):  # type: ignore[no-untyped-def]
    """Return whether `count` vertices, which the first `columns` deviations move, have n . x < level."""
    for v in range(count):
        x = row(vertices, v)
        for j in range(columns):
            x = along(x, deviations[k, j], row_of(motions, v, j))
        if not dot(n, x) < level:
            return False
    return True


@inlined_uncounted
def _is_around(core, radius, vertices, count, motions, columns, k, deviations):  # type: ignore[no-untyped-def]
    """Return whether the distances of `count` vertices from the core are below a radius; see _is_below."""
    u, start, span = core
    square = dot(span, span)
    inverse = 1.0 / square if square > 0.0 else 0.0
    for v in range(count):
        x = row(vertices, v)
        for j in range(columns):
            x = along(x, deviations[k, j], row_of(motions, v, j))
        arm = minus(x, start)
        arm = along(arm, -dot(arm, u), u)
        if square > 0.0:
            arm = along(arm, -min(max(dot(arm, span) * inverse, 0.0), 1.0), span)
        if not dot(arm, arm) < radius * radius:
            return False
    return True


@uncounted
def _holds(region, k, X, inner, levels, count):  # type: ignore[no-untyped-def]
    """Return whether the first `count` vertices of the inner body that are fixed, and all that move, lie in the region."""
    last, moving, columns = region.normals.shape[0], region.moving.shape[0], region.motions.shape[1]
    for i in range(last):  # in the frame of the inner body, so that its vertices need not be moved
        n, t = row(region.normals, i), (X[9], X[10], X[11])
        level = levels[i] - dot(n, t) if region.is_forward else levels[i] + dot(turn(X, n), t)
        n = turn_back(X, n) if region.is_forward else turn(X, n)
        if not (
            _is_below(n, level, region.fixed, count, region.motions, 0, k, inner)
            and _is_below(n, level, region.moving, moving, region.motions, columns, k, inner)
        ):
            return False
    radius = levels[last]
    if radius == np.inf:
        return True
    u, start, span = row(region.core, 0), row(region.core, 1), row(region.core, 2)
    if region.is_forward:
        core = turn_back(X, u), move_back(X, start), turn_back(X, span)
    else:
        core = turn(X, u), move(X, start), turn(X, span)
    return (
        radius > 0.0
        and _is_around(core, radius, region.fixed, count, region.motions, 0, k, inner)
        and _is_around(core, radius, region.moving, moving, region.motions, columns, k, inner)
    )


@compiled
def certify(region, poses, outer, inner, are_apart):  # type: ignore[no-untyped-def]
    """Write true for realizations (n,) whose inner body lies in the region at poses X_BA (n, 12).

    outer, inner   (n, k), (n, j): deviations of both bodies
    are_apart      (n,): realizations that are true already are left out
    """
    levels = np.empty(region.levels.size)
    for k in range(poses.shape[0]):
        if are_apart[k]:
            continue
        X, drop = poses[k], 0.0
        growth = _sum_of_sizes(region.farthest, inner, k)
        fall = _sum_of_sizes(region.steepest, outer, k)
        margin = ROUNDED * (region.size + growth + fall)
        for i in range(levels.size):
            levels[i] = _level(region, i, k, outer, fall) - margin
            if levels[i] < np.inf:
                drop = max(drop, region.levels[i] - levels[i])
        # A fixed vertex with a larger slack is inside, since values of constraints change no faster than points move.
        bound = motion_of(X, region.box) + drop
        are_apart[k] = bound < np.inf and _holds(region, k, X, inner, levels, near_count(region.slacks, bound))
