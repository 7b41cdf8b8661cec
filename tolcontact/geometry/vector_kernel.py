"""Compiled arithmetic of vectors and poses, and whether points lie over triangles and inside bodies."""

import functools
import math

import numpy as np

from tolcontact.compiled import compiled

inlined = functools.partial(compiled, inline=True)


@inlined
def dot(a, b):  # type: ignore[no-untyped-def]
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b, out):  # type: ignore[no-untyped-def]
    """Write a x b."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@inlined
def turn(X, v, out):  # type: ignore[no-untyped-def]
    """Write R v."""
    for i in range(3):
        out[i] = X[3 * i] * v[0] + X[3 * i + 1] * v[1] + X[3 * i + 2] * v[2]


@inlined
def turn_back(X, v, out):  # type: ignore[no-untyped-def]
    """Write R' v."""
    for i in range(3):
        out[i] = X[i] * v[0] + X[3 + i] * v[1] + X[6 + i] * v[2]


@inlined
def move_back(X, x, scratch, out):  # type: ignore[no-untyped-def]
    """Write R' (x - t)."""
    for i in range(3):
        scratch[i] = x[i] - X[9 + i]
    turn_back(X, scratch, out)


@inlined
def is_over(corners, inward, x, margin):  # type: ignore[no-untyped-def]
    """Return whether x lies over a triangle, not beside one of its edges."""
    over = True
    for j in range(3):
        aside = 0.0
        for i in range(3):
            aside += inward[j, i] * (x[i] - corners[j, i])
        over = over and aside >= -margin
    return over


@inlined
def is_beside(facets, inward, facet, points, point, spare):  # type: ignore[no-untyped-def]
    """Return whether a point lies beside a facet, by more than `spare` [mm]."""
    lowest = 0.0
    for j in range(3):
        aside = 0.0
        for i in range(3):
            aside += inward[facet, j, i] * (points[point, i] - facets[facet, j, i])
        lowest = min(lowest, aside)
    return lowest < -spare


@compiled
def is_within(outline, x, y, spare):  # type: ignore[no-untyped-def]
    """Return whether (x, y) lies inside an outline of segments (segment, 4), or no farther than `spare` beside one."""
    inside = False
    for k in range(outline.shape[0]):
        x0, y0, x1, y1 = outline[k, 0], outline[k, 1], outline[k, 2], outline[k, 3]
        if (y0 > y) != (y1 > y) and x < x0 + (x1 - x0) * (y - y0) / (y1 - y0):
            inside = not inside
    if inside:
        return True
    for k in range(outline.shape[0]):
        x0, y0, x1, y1 = outline[k, 0], outline[k, 1], outline[k, 2], outline[k, 3]
        if min(x0, x1) > x + spare or max(x0, x1) < x - spare or min(y0, y1) > y + spare or max(y0, y1) < y - spare:
            continue
        dx, dy = x1 - x0, y1 - y0
        share = min(max(((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
        aside_x, aside_y = x - x0 - share * dx, y - y0 - share * dy
        if aside_x * aside_x + aside_y * aside_y <= spare * spare:
            return True
    return False


@compiled
def is_inside(triangles, x):  # type: ignore[no-untyped-def]
    """Return whether x lies in a closed body: its triangles fill half of all solid angles or more. No triangles hold all.

    The solid angle of a triangle is that of van Oosterom and Strackee (1983).
    """
    if triangles.shape[0] == 0:
        return True
    total = 0.0
    a, b, c, bc = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(triangles.shape[0]):
        for i in range(3):
            a[i], b[i], c[i] = triangles[k, 0, i] - x[i], triangles[k, 1, i] - x[i], triangles[k, 2, i] - x[i]
        length_a, length_b, length_c = math.sqrt(dot(a, a)), math.sqrt(dot(b, b)), math.sqrt(dot(c, c))
        cross(b, c, bc)
        near = length_a * length_b * length_c + dot(a, b) * length_c + dot(b, c) * length_a + dot(c, a) * length_b
        total += math.atan2(dot(a, bc), near)
    return total > math.pi  # half of the solid angle, 2 pi inside
