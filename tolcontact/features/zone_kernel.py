"""Compiled search of minimum zones, one field of heights after another, by exchange of the places that the zone touches.

The touched places are a reference of freedom + 1 places with a side of the zone each. Two linear systems belong to a reference:
its `equidistant` system gives the centre with equal distances from its places, its `dual` system the weights of these.
"""

import numpy as np

from tolcontact.compiled import compiled, inner

MIN_STEP = 1e-12
IDLE = 1e-6  # weight of a place without which the zone would be as wide
PARALLEL = 1e-9  # of the largest height of a displacement: smaller ones are rounding


@compiled
def sum_modes(coefficients, modes, heights):  # type: ignore[no-untyped-def]
    """Add sums of modes (mode, place) times coefficients (n, mode) to heights (n, place), in a fixed order."""
    for k in range(coefficients.shape[0]):
        row = heights[k]
        for c in range(modes.shape[0]):
            factor, mode = coefficients[k, c], modes[c]
            for j in range(row.size):
                row[j] += factor * mode[j]


@compiled
def exchange(heights, exact, rows, initial, initial_signs, limit, closeness, centres, widths):  # type: ignore[no-untyped-def]
    """Write the minimum zone of each field of heights (n, place); NaN as its width where exchanges do not end.

    If several zones have that width, the centre is the one with the smallest sum of squared residuals.

    exact          (freedom, place): heights of unit displacements
    rows           (freedom, place): the same for the search, which might cycle among collinear places
    initial        (freedom + 1,) indices of the places of the first reference
    initial_signs  (freedom + 1,) 1 or -1: the sides of the zone that they are on
    limit          number of exchanges
    closeness      share of the width: places that are no further out are in the zone
    centres        (n, freedom) displacements of the centre of the zone, written
    widths         (n,), written
    """
    size = rows.shape[0] + 1
    matrix, solution, direction = np.empty((size, size)), np.empty(size), np.empty(size)
    places, signs, residuals = np.empty(size, dtype=np.int64), np.empty(size), np.empty(heights.shape[1])
    for k in range(heights.shape[0]):
        places[:], signs[:], widths[k] = initial, initial_signs, np.nan
        for _ in range(limit):
            for c in range(size):
                solution[c] = signs[c] * heights[k, places[c]]
            fill_equidistant(rows, places, signs, matrix)
            if not solve(matrix, solution):
                break
            entering, largest = outermost(heights[k], rows, solution, residuals)
            if abs(largest) <= solution[size - 1] * (1 + closeness) + 1e-300:
                widths[k] = refine(heights[k], exact, rows, places, signs, matrix, solution, residuals, centres[k])
                settle(heights[k], exact, places, signs, matrix, direction, residuals, widths[k] / 2, centres[k])
                break
            sign = 1.0 if largest > 0 else -1.0
            leaving = find_leaving(rows, places, signs, entering, sign, matrix, solution, direction)
            if leaving < 0:
                break
            places[leaving], signs[leaving] = entering, sign


@inner
def fill_equidistant(rows, places, signs, matrix):  # type: ignore[no-untyped-def]
    """Write the system whose solution is a displacement of the centre and the distance of all places from it."""
    freedom = rows.shape[0]
    for c in range(freedom + 1):
        for i in range(freedom):
            matrix[c, i] = signs[c] * rows[i, places[c]]
        matrix[c, freedom] = 1.0


@inner
def fill_dual(rows, places, signs, matrix):  # type: ignore[no-untyped-def]
    """Write the system whose solution is the weights of the places."""
    freedom = rows.shape[0]
    for c in range(freedom + 1):
        for i in range(freedom):
            matrix[i, c] = signs[c] * rows[i, places[c]]
        matrix[freedom, c] = 1.0


@inner
def outermost(field, rows, centre, residuals):  # type: ignore[no-untyped-def]
    """Return the place with the largest distance from a centre, and its residual there.

    `residuals` (place,) are written: the heights of all places over the centre.
    """
    for j in range(field.size):
        residuals[j] = field[j]
    for i in range(rows.shape[0]):
        factor, row = centre[i], rows[i]
        for j in range(field.size):
            residuals[j] -= factor * row[j]
    place, largest = 0, 0.0
    for j in range(field.size):
        if abs(residuals[j]) > largest:
            place, largest = j, abs(residuals[j])
    return place, residuals[place]


@inner
def find_leaving(rows, places, signs, entering, sign, matrix, weights, changes):  # type: ignore[no-untyped-def]
    """Return which place of the reference another one replaces, so that the zone of the reference grows; -1: none.

    The weights of the reference, and their changes by a unit weight of the entering place, are written.
    """
    freedom = rows.shape[0]
    for i in range(freedom):
        weights[i], changes[i] = 0.0, sign * rows[i, entering]
    weights[freedom], changes[freedom] = 1.0, 1.0
    fill_dual(rows, places, signs, matrix)
    if not solve(matrix, weights):
        return -1
    fill_dual(rows, places, signs, matrix)
    solve(matrix, changes)
    leaving, smallest = -1, np.inf
    for c in range(freedom + 1):
        if changes[c] > MIN_STEP and max(weights[c], 0.0) / changes[c] < smallest:
            leaving, smallest = c, max(weights[c], 0.0) / changes[c]
    return leaving


@inner
def refine(field, exact, rows, places, signs, matrix, solution, residuals, centre):  # type: ignore[no-untyped-def]
    """Write the centre of a zone by exact heights, from the `solution` by `rows`; return the width of the zone."""
    freedom, distance = rows.shape[0], solution[rows.shape[0]]
    for i in range(freedom):
        centre[i] = solution[i]
    _, before = outermost(field, exact, centre, residuals)
    for c in range(freedom + 1):
        residual = field[places[c]]
        for i in range(freedom):
            residual -= exact[i, places[c]] * centre[i]
        solution[c] = signs[c] * residual - distance
    fill_equidistant(rows, places, signs, matrix)
    if solve(matrix, solution):
        for i in range(freedom):
            solution[i] += centre[i]
        _, after = outermost(field, exact, solution, residuals)
        if abs(after) <= abs(before):
            for i in range(freedom):
                centre[i] = solution[i]
            return 2 * abs(after)
    return 2 * abs(before)


@inner
def settle(field, exact, places, signs, matrix, direction, residuals, half, centre):  # type: ignore[no-untyped-def]
    """Move the centre of a zone of this half width to the least squares, if it is not unique (collinear places)."""
    freedom = exact.shape[0]
    for c in range(freedom + 1):
        direction[c] = 1.0 if c == freedom else 0.0
    fill_dual(exact, places, signs, matrix)
    if not solve(matrix, direction):
        return
    idle = 0
    for c in range(freedom + 1):
        idle = c if direction[c] < direction[idle] else idle
    if direction[idle] > IDLE:
        return
    for c in range(freedom + 1):
        direction[c] = 1.0 if c == idle else 0.0
    fill_equidistant(exact, places, signs, matrix)
    if solve(matrix, direction):
        outermost(field, exact, centre, residuals)
        step = best_step(exact, direction, residuals, half)
        for i in range(freedom):
            centre[i] += step * direction[i]


@inner
def best_step(exact, direction, residuals, half):  # type: ignore[no-untyped-def]
    """Return the step of a centre in a direction (freedom,) to the least squares, within the zone of this half width.

    residuals   (place,) heights over the centre before
    """
    reach = 0.0
    for j in range(residuals.size):
        reach = max(reach, abs(height_of(exact, direction, j)))
    low, high, moment, inertia = -np.inf, np.inf, 0.0, 0.0
    for j in range(residuals.size):
        height = height_of(exact, direction, j)
        moment += residuals[j] * height
        inertia += height * height
        if abs(height) > PARALLEL * reach:
            ends = (residuals[j] - half) / height, (residuals[j] + half) / height
            low, high = max(low, min(ends)), min(high, max(ends))
    return min(max(moment / inertia, low), high) if low < high else 0.0


@inner
def height_of(exact, displacement, j):  # type: ignore[no-untyped-def]
    """Return the height of place j for a displacement (freedom,)."""
    height = 0.0
    for i in range(exact.shape[0]):
        height += exact[i, j] * displacement[i]
    return height


@inner
def solve(matrix, vector):  # type: ignore[no-untyped-def]
    """Solve matrix x = vector, in place, by elimination with pivots; return whether that was possible."""
    size = matrix.shape[0]
    for p in range(size):
        pivot = p
        for i in range(p + 1, size):
            if abs(matrix[i, p]) > abs(matrix[pivot, p]):
                pivot = i
        if matrix[pivot, p] == 0.0:
            return False
        for j in range(p, size):
            matrix[p, j], matrix[pivot, j] = matrix[pivot, j], matrix[p, j]
        vector[p], vector[pivot] = vector[pivot], vector[p]
        for i in range(p + 1, size):
            factor = matrix[i, p] / matrix[p, p]
            for j in range(p + 1, size):
                matrix[i, j] -= factor * matrix[p, j]
            vector[i] -= factor * vector[p]
    for p in range(size - 1, -1, -1):
        value = vector[p]
        for i in range(p + 1, size):
            value -= matrix[p, i] * vector[i]
        vector[p] = value / matrix[p, p]
    return True
