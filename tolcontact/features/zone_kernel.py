"""Compiled search of least zones, one field of heights after another: places that the zone touches are exchanged."""

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
def exchange(heights, exact, rows, first, first_signs, limit, closeness, solutions, widths):  # type: ignore[no-untyped-def]
    """Write the least zone of each field of heights (n, place); NaN as its width where exchanges do not end.

    Of several zones of that width it is the one with the least sum of squared heights from its middle.

    exact        (freedom, place): heights of displacements of 1
    rows         (freedom, place): the same for the search, which might cycle among places in line
    first        (freedom + 1,) numbers of places from which searches start
    first_signs  (freedom + 1,) 1 or -1: the sides of the zone that they are on
    limit        number of exchanges
    closeness    share of the width: places that are no farther out are in the zone
    solutions    (n, freedom) displacements of the middle of the zone, written
    widths       (n,), written
    """
    freedom = rows.shape[0]
    size = freedom + 1
    matrix, right = np.empty((size, size)), np.empty((size, 2))
    chosen, signs, residuals = np.empty(size, dtype=np.int64), np.empty(size), np.empty(heights.shape[1])
    for k in range(heights.shape[0]):
        chosen[:], signs[:], widths[k] = first, first_signs, np.nan
        for _ in range(limit):
            if not find_middle(heights[k], rows, chosen, signs, matrix, right):
                break
            entering, largest = farthest(heights[k], rows, right, residuals)
            if abs(largest) <= right[freedom, 0] * (1 + closeness) + 1e-300:
                widths[k] = refine(heights[k], exact, rows, chosen, signs, matrix, right, residuals, solutions[k])
                settle(heights[k], exact, chosen, signs, matrix, right, residuals, widths[k] / 2, solutions[k])
                break
            sign = 1.0 if largest > 0 else -1.0
            leaving = find_leaving(rows, chosen, signs, entering, sign, matrix, right)
            if leaving < 0:
                break
            chosen[leaving], signs[leaving] = entering, sign


@inner
def find_middle(field, rows, chosen, signs, matrix, right):  # type: ignore[no-untyped-def]
    """Write the middle from which all chosen places are equally far, and their distance, to the first column of `right`."""
    freedom = rows.shape[0]
    for c in range(freedom + 1):
        for i in range(freedom):
            matrix[c, i] = signs[c] * rows[i, chosen[c]]
        matrix[c, freedom] = 1.0
        right[c, 0] = signs[c] * field[chosen[c]]
    return solve(matrix, right, 1)


@inner
def farthest(field, rows, middle, residuals):  # type: ignore[no-untyped-def]
    """Return the place that is farthest from the middle in the first column of an array, and its height from there.

    `residuals` (place,) are written: all heights from there.
    """
    for j in range(field.size):
        residuals[j] = field[j]
    for i in range(rows.shape[0]):
        factor, row = middle[i, 0], rows[i]
        for j in range(field.size):
            residuals[j] -= factor * row[j]
    place, largest = 0, 0.0
    for j in range(field.size):
        if abs(residuals[j]) > largest:
            place, largest = j, abs(residuals[j])
    return place, residuals[place]


@inner
def find_leaving(rows, chosen, signs, entering, sign, matrix, right):  # type: ignore[no-untyped-def]
    """Return which of the chosen places another one replaces, so that the zone stays the least one of these; -1: none."""
    freedom = rows.shape[0]
    for i in range(freedom):
        for c in range(freedom + 1):
            matrix[i, c] = signs[c] * rows[i, chosen[c]]
        right[i, 0], right[i, 1] = 0.0, sign * rows[i, entering]
    for c in range(freedom + 1):
        matrix[freedom, c] = 1.0
    right[freedom, 0], right[freedom, 1] = 1.0, 1.0
    leaving, least = -1, np.inf
    if solve(matrix, right, 2):
        for c in range(freedom + 1):
            if right[c, 1] > MIN_STEP and max(right[c, 0], 0.0) / right[c, 1] < least:
                leaving, least = c, max(right[c, 0], 0.0) / right[c, 1]
    return leaving


@inner
def refine(field, exact, rows, chosen, signs, matrix, right, residuals, solution):  # type: ignore[no-untyped-def]
    """Write the middle of a zone by exact heights, from that by `rows` in `right`; return the width of the zone."""
    freedom, distance = rows.shape[0], right[rows.shape[0], 0]
    for i in range(freedom):
        solution[i] = right[i, 0]
    _, before = farthest(field, exact, right, residuals)
    for c in range(freedom + 1):
        residual = field[chosen[c]]
        for i in range(freedom):
            matrix[c, i] = signs[c] * rows[i, chosen[c]]
            residual -= exact[i, chosen[c]] * solution[i]
        matrix[c, freedom] = 1.0
        right[c, 0] = signs[c] * residual - distance
    if solve(matrix, right, 1):
        for i in range(freedom):
            right[i, 0] += solution[i]
        _, after = farthest(field, exact, right, residuals)
        if abs(after) <= abs(before):
            for i in range(freedom):
                solution[i] = right[i, 0]
            return 2 * abs(after)
    return 2 * abs(before)


@inner
def settle(field, exact, chosen, signs, matrix, right, residuals, half, solution):  # type: ignore[no-untyped-def]
    """Move the middle of a zone of this half width, if it can turn about places in line, to the least sum of squares."""
    freedom = exact.shape[0]
    for i in range(freedom):
        for c in range(freedom + 1):
            matrix[i, c] = signs[c] * exact[i, chosen[c]]
        right[i, 0] = 0.0
    for c in range(freedom + 1):
        matrix[freedom, c] = 1.0
    right[freedom, 0] = 1.0
    if not solve(matrix, right, 1):
        return
    idle = 0
    for c in range(freedom + 1):
        idle = c if right[c, 0] < right[idle, 0] else idle
    if right[idle, 0] > IDLE:
        return
    for c in range(freedom + 1):
        for i in range(freedom):
            matrix[c, i] = signs[c] * exact[i, chosen[c]]
        matrix[c, freedom], right[c, 0] = 1.0, 1.0 if c == idle else 0.0
    if not solve(matrix, right, 1):
        return
    for i in range(freedom):
        right[i, 1], right[i, 0] = right[i, 0], solution[i]
    farthest(field, exact, right, residuals)
    turn = best_turn(exact, right, residuals, half)
    for i in range(freedom):
        solution[i] += turn * right[i, 1]


@inner
def best_turn(exact, turns, residuals, half):  # type: ignore[no-untyped-def]
    """Return how far a middle moves by the displacement in the second column of `turns`, within the zone, to the least squares.

    residuals   (place,) heights from the middle before
    """
    reach = 0.0
    for j in range(residuals.size):
        reach = max(reach, abs(height_of(exact, turns, j)))
    low, high, moment, inertia = -np.inf, np.inf, 0.0, 0.0
    for j in range(residuals.size):
        height = height_of(exact, turns, j)
        moment += residuals[j] * height
        inertia += height * height
        if abs(height) > PARALLEL * reach:
            ends = (residuals[j] - half) / height, (residuals[j] + half) / height
            low, high = max(low, min(ends)), min(high, max(ends))
    return min(max(moment / inertia, low), high) if low < high else 0.0


@inner
def height_of(exact, turns, j):  # type: ignore[no-untyped-def]
    """Return the height of a place by the displacement in the second column of `turns`."""
    height = 0.0
    for i in range(exact.shape[0]):
        height += exact[i, j] * turns[i, 1]
    return height


@inner
def solve(matrix, right, columns):  # type: ignore[no-untyped-def]
    """Solve matrix x = right for some columns, in place, by elimination with pivots; return whether that was possible."""
    size = matrix.shape[0]
    for p in range(size):
        if not bring_pivot(matrix, right, p, columns):
            return False
        for i in range(p + 1, size):
            factor = matrix[i, p] / matrix[p, p]
            for j in range(p + 1, size):
                matrix[i, j] -= factor * matrix[p, j]
            for j in range(columns):
                right[i, j] -= factor * right[p, j]
    for j in range(columns):
        for p in range(size - 1, -1, -1):
            value = right[p, j]
            for i in range(p + 1, size):
                value -= matrix[p, i] * right[i, j]
            right[p, j] = value / matrix[p, p]
    return True


@inner
def bring_pivot(matrix, right, p, columns):  # type: ignore[no-untyped-def]
    """Exchange row p for the one below with the largest entry in column p; return whether that is not 0."""
    pivot = p
    for i in range(p + 1, matrix.shape[0]):
        if abs(matrix[i, p]) > abs(matrix[pivot, p]):
            pivot = i
    if pivot != p:
        for j in range(p, matrix.shape[0]):
            matrix[p, j], matrix[pivot, j] = matrix[pivot, j], matrix[p, j]
        for j in range(columns):
            right[p, j], right[pivot, j] = right[pivot, j], right[p, j]
    return matrix[p, p] != 0.0
