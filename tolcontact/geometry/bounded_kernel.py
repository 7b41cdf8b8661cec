"""Compiled passes over places that are searched at every pose, separately for each realization."""

import numpy as np

from tolcontact.compiled import compiled, inlined_uncounted, uncounted


@inlined_uncounted
def _gap(X, places, feet, normals, heights, k, p):  # type: ignore[no-untyped-def]
    """Return the gap of place p of realization k at X_RM (12,), above a plane raised by its height."""
    gap = -heights[k, p]
    for i in range(3):
        x = X[9 + i] - feet[k, p, i]
        for j in range(3):
            x += X[3 * i + j] * places[k, p, j]
        gap += x * normals[k, p, i]
    return gap


@compiled
def gaps(relative, places, feet, normals, heights, valid, values):  # type: ignore[no-untyped-def]
    """Write the gaps (n, place) at X_RM (n, 12), above planes raised by heights (n, place); infinite where not valid."""
    for k in range(relative.shape[0]):
        for p in range(places.shape[1]):
            values[k, p] = _gap(relative[k], places, feet, normals, heights, k, p) if valid[k, p] else np.inf


@compiled
def deepest(relative, labels, places, feet, normals, heights, valid, distance, numbers, depths):  # type: ignore[no-untyped-def]
    """Write labels and depths of the deepest places (n, m) at X_RM (n, 12), deepest first.

    Where there are fewer places, it writes some label, and -inf. Places outside within a `distance` [mm] of a deeper one are
    left out: of two that nearly coincide, either could be active, and the choice should not be left to the solver.
    """
    for k in range(labels.shape[0]):
        count = 0
        for p in range(labels.shape[1]):
            if not valid[k, p]:
                continue
            depth = -_gap(relative[k], places, feet, normals, heights, k, p)
            if not depth > -np.inf:
                continue
            j = min(count, numbers.shape[1] - 1)
            if count == numbers.shape[1] and depth <= depths[k, j]:
                continue
            while j > 0 and depths[k, j - 1] < depth:
                numbers[k, j], depths[k, j], j = numbers[k, j - 1], depths[k, j - 1], j - 1
            numbers[k, j], depths[k, j] = p, depth
            count = min(count + 1, numbers.shape[1])
        for j in range(numbers.shape[1]):
            if j >= count or (depths[k, j] <= 0 and _is_near(feet, numbers, depths, k, j, distance)):
                depths[k, j] = -np.inf
        for j in range(numbers.shape[1]):
            numbers[k, j] = max(labels[k, numbers[k, j] if j < count else 0], 0)


@uncounted
def _is_near(feet, columns, depths, k, j, distance):  # type: ignore[no-untyped-def]
    """Return whether the projection in column j is within a distance of one in an earlier column that counts."""
    is_near = False
    for other in range(j):
        away = 0.0
        for i in range(3):
            away += (feet[k, columns[k, other], i] - feet[k, columns[k, j], i]) ** 2
        is_near = is_near or (depths[k, other] > -np.inf and away < distance * distance)
    return is_near


@compiled
def gather(points, labels, places, feet, normals, heights, P_m, P_r, n_r):  # type: ignore[no-untyped-def]
    """Write P_m, P_r, n_r (n, slot, 3) of the places with labels `points` (n, slot); of the first place if there is none.

    Label -1 is none, though further columns may have it: how many there are depends on the other poses.
    """
    for k in range(points.shape[0]):
        for s in range(points.shape[1]):
            column = 0
            for p in range(labels.shape[1] if points[k, s] >= 0 else 0):
                if labels[k, p] == points[k, s]:
                    column = p
                    break
            for i in range(3):
                P_m[k, s, i], n_r[k, s, i] = places[k, column, i], normals[k, column, i]
                P_r[k, s, i] = feet[k, column, i] + heights[k, column] * normals[k, column, i]


@compiled
def contains(points, labels, valid, found):  # type: ignore[no-untyped-def]
    """Write whether each of the `points` (n, slot) is among the labels (n, place) of valid places."""
    for k in range(points.shape[0]):
        for s in range(points.shape[1]):
            found[k, s] = False
            for p in range(labels.shape[1]):
                if labels[k, p] == points[k, s]:
                    found[k, s] = valid[k, p]
                    break
