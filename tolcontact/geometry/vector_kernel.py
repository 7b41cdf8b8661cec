"""Compiled arithmetic of vectors and poses, and whether points lie over triangles and inside bodies."""

import math

from tolcontact.compiled import inlined_uncounted, uncounted


@inlined_uncounted
def row(vectors, k):  # type: ignore[no-untyped-def]
    """Return row k of an array (n, 3). Vectors are tuples: array views would cost more than the arithmetic."""
    return vectors[k, 0], vectors[k, 1], vectors[k, 2]


@inlined_uncounted
def row_of(vectors, k, j):  # type: ignore[no-untyped-def]
    """Return a vector of an array (n, m, 3)."""
    return vectors[k, j, 0], vectors[k, j, 1], vectors[k, j, 2]


@inlined_uncounted
def dot(a, b):  # type: ignore[no-untyped-def]
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined_uncounted
def cross(a, b):  # type: ignore[no-untyped-def]
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined_uncounted
def minus(a, b):  # type: ignore[no-untyped-def]
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined_uncounted
def scaled(s, a):  # type: ignore[no-untyped-def]
    """Return s a."""
    return s * a[0], s * a[1], s * a[2]


@inlined_uncounted
def along(a, s, b):  # type: ignore[no-untyped-def]
    """Return a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@inlined_uncounted
def turn(X, v):  # type: ignore[no-untyped-def]
    """Return R v for a pose X (12,)."""
    return (
        X[0] * v[0] + X[1] * v[1] + X[2] * v[2],
        X[3] * v[0] + X[4] * v[1] + X[5] * v[2],
        X[6] * v[0] + X[7] * v[1] + X[8] * v[2],
    )


@inlined_uncounted
def turn_back(X, v):  # type: ignore[no-untyped-def]
    """Return R' v for a pose X (12,)."""
    return (
        X[0] * v[0] + X[3] * v[1] + X[6] * v[2],
        X[1] * v[0] + X[4] * v[1] + X[7] * v[2],
        X[2] * v[0] + X[5] * v[1] + X[8] * v[2],
    )


@inlined_uncounted
def move(X, v):  # type: ignore[no-untyped-def]
    """Return R v + t for a pose X (12,)."""
    return along(turn(X, v), 1.0, (X[9], X[10], X[11]))


@inlined_uncounted
def move_back(X, x):  # type: ignore[no-untyped-def]
    """Return R' (x - t) for a pose X (12,)."""
    return turn_back(X, minus(x, (X[9], X[10], X[11])))


@inlined_uncounted
def is_over(facets, inward, facet, x, margin):  # type: ignore[no-untyped-def]
    """Return whether x lies over a facet, or outside one of its edges by no more than a margin [mm]."""
    lowest = 0.0
    for j in range(3):
        lowest = min(lowest, dot(row_of(inward, facet, j), minus(x, row_of(facets, facet, j))))
    return lowest >= -margin


@inlined_uncounted
def first_from(values, start, end, least):  # type: ignore[no-untyped-def]
    """Return the first of the rows start to end, in ascending order of their first value, whose first value is >= `least`."""
    while start < end:
        middle = (start + end) // 2
        if values[middle, 0] < least:
            start = middle + 1
        else:
            end = middle
    return start


@uncounted
def is_within(segments, bands, first, last, span, x, y, spare):  # type: ignore[no-untyped-def]
    """Return whether (x, y) lies inside an outline, or outside it by no more than `spare`.

    The outline is cut into bands of equal height along y, from `span[0]` to `span[1]`. Bands `first` to `last` belong to it;
    rows bands[k] to bands[k + 1] of `segments` (row, 4), with x and y of both ends, reach into band k.
    """
    low, high = span[0], span[1]
    if not (low - spare <= y <= high + spare):
        return False
    rate = (last - first) / (high - low)
    own = first + math.floor((y - low) * rate)
    start = max(first + math.floor((y - spare - low) * rate), first)
    end = min(first + math.floor((y + spare - low) * rate), last - 1)
    inside = False
    for band in range(start, end + 1):
        for k in range(bands[band], bands[band + 1]):
            x0, y0, x1, y1 = segments[k, 0], segments[k, 1], segments[k, 2], segments[k, 3]
            if band == own and (y0 > y) != (y1 > y) and x < x0 + (x1 - x0) * (y - y0) / (y1 - y0):
                inside = not inside
            if not (min(x0, x1) > x + spare or max(x0, x1) < x - spare or max(y0, y1) < y - spare or min(y0, y1) > y + spare):
                dx, dy = x1 - x0, y1 - y0
                share = min(max(((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
                aside_x, aside_y = x - x0 - share * dx, y - y0 - share * dy
                if aside_x * aside_x + aside_y * aside_y <= spare * spare:
                    return True
    return inside


@inlined_uncounted
def half_solid_angle(a, b, c):  # type: ignore[no-untyped-def]
    """Return half the signed solid angle of a triangle as seen from the origin (van Oosterom and Strackee, 1983)."""
    length_a, length_b, length_c = math.sqrt(dot(a, a)), math.sqrt(dot(b, b)), math.sqrt(dot(c, c))
    near = length_a * length_b * length_c + dot(a, b) * length_c + dot(b, c) * length_a + dot(c, a) * length_b
    return math.atan2(dot(a, cross(b, c)), near)


@uncounted
def is_inside(triangles, x):  # type: ignore[no-untyped-def]
    """Return whether x lies in a closed body: its triangles cover at least half of the full solid angle.

    The result is True if there are no triangles.
    """
    if triangles.shape[0] == 0:
        return True
    total = 0.0
    for k in range(triangles.shape[0]):
        a, b, c = minus(row_of(triangles, k, 0), x), minus(row_of(triangles, k, 1), x), minus(row_of(triangles, k, 2), x)
        total += half_solid_angle(a, b, c)
    return total > math.pi  # half of the solid angle, 2 pi inside
