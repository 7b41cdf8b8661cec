"""Compiled local minima of the gap between two planes with form deviation."""

import math

import numpy as np

from tolcontact.compiled import compiled, inner
from tolcontact.geometry.height_kernel import coordinates, gap_at, write_map

MAX_STEPS = 10  # per local search
STEP_SHARE = 1e-2  # of the reach: a smaller step ends the search
SPARE_FALL = 6.0  # times the predicted decrease of a step
BASIN_SHARE = 0.5  # of the reach: a start nearer than this to the end of an earlier search is skipped
NEAR_SHARE = 0.05  # of the reach: minima nearer than this to each other are one
ON_EDGE = 1e-9  # of the reach
CELLS = 1 << 26  # along each side of the box around a moving plane, in the labels of its points
FIRST_PLACE = 1 << 60  # label of the first of these points


@inner
def _write_edges(moving, reference, along, edges):  # type: ignore[no-untyped-def]
    """Write the edges of both rims (edge, 7) in coordinates of the moving plane."""
    count = moving.edges.shape[0]
    for e in range(count):
        for c in range(7):
            edges[e, c] = moving.edges[e, c]
    a, b, c, d = along[0, 0], along[0, 1], along[1, 0], along[1, 1]
    scale = 1 / (a * d - b * c)
    for e in range(reference.edges.shape[0]):
        edge = edges[count + e]
        x, y = reference.edges[e, 0] - along[0, 2], reference.edges[e, 1] - along[1, 2]
        edge[0], edge[1] = scale * (d * x - b * y), scale * (a * y - c * x)
        x, y = reference.edges[e, 2], reference.edges[e, 3]
        edge[2], edge[3] = scale * (d * x - b * y), scale * (a * y - c * x)
        stretch = math.sqrt(edge[2] * edge[2] + edge[3] * edge[3])
        edge[2], edge[3], edge[4] = edge[2] / stretch, edge[3] / stretch, reference.edges[e, 4] * stretch
        x, y = reference.edges[e, 5], reference.edges[e, 6]
        side = 1.0 if (scale * (d * x - b * y)) * -edge[3] + (scale * (a * y - c * x)) * edge[2] > 0 else -1.0
        edge[5], edge[6] = -side * edge[3], side * edge[2]


@inner
def _share(edges, u, v, du, dv, slack, skipped):  # type: ignore[no-untyped-def]
    """Return the share of a step du, dv at which it leaves the faces; 1 if it does not. One edge may be skipped."""
    share = 1.0
    for e in range(edges.shape[0]):
        rate = du * edges[e, 5] + dv * edges[e, 6]
        if e == skipped or rate >= 0:
            continue
        inside = (u - edges[e, 0]) * edges[e, 5] + (v - edges[e, 1]) * edges[e, 6]
        if inside < -slack:
            continue
        part = max(inside, 0.0) / -rate
        if part < share:
            along = (u + part * du - edges[e, 0]) * edges[e, 2] + (v + part * dv - edges[e, 1]) * edges[e, 3]
            if -slack <= along <= edges[e, 4] + slack:
                share = part
    return share


@inner
def _slide(edges, u, v, du, dv, derivatives, reach, slack):  # type: ignore[no-untyped-def]
    """Return the longest step du, dv towards the smallest gap along an edge that blocks a step at u, v."""
    g_u, g_v, g_uu, g_uv, g_vv = derivatives
    longest, best_u, best_v = 0.0, 0.0, 0.0
    for e in range(edges.shape[0]):
        inside = (u - edges[e, 0]) * edges[e, 5] + (v - edges[e, 1]) * edges[e, 6]
        along = (u - edges[e, 0]) * edges[e, 2] + (v - edges[e, 1]) * edges[e, 3]
        if abs(inside) > slack or du * edges[e, 5] + dv * edges[e, 6] >= 0 or not -slack <= along <= edges[e, 4] + slack:
            continue
        x, y = edges[e, 2], edges[e, 3]
        slope, bend = g_u * x + g_v * y, g_uu * x * x + 2 * g_uv * x * y + g_vv * y * y
        step = -slope / bend if bend * reach > abs(slope) else -math.copysign(reach, slope)
        step = min(max(step, -along), edges[e, 4] - along)
        step *= _share(edges, u, v, step * x, step * y, slack, e)
        if abs(step) > longest:
            longest, best_u, best_v = abs(step), step * x, step * y
    return best_u, best_v


@inner
def _descend(moving, reference, sums_m, sums_r, row, along, edges, u, v, reach, level, weights, scratch, best):  # type: ignore
    """Write the coordinates and the value (3,) of the local minimum of the gap over both faces, from a start at u, v.

    The search ends once the gap is unlikely to fall below a level [mm].
    """
    slack = ON_EDGE * reach
    best[2] = np.inf
    for _ in range(MAX_STEPS):
        gap = gap_at(moving, reference, sums_m, sums_r, row, along, u, v, weights, scratch)
        if not gap < best[2]:
            break
        best[0], best[1], best[2] = u, v, gap
        g_u, g_v, g_uu, g_uv, g_vv = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
        determinant, steepness = g_uu * g_vv - g_uv * g_uv, math.sqrt(g_u * g_u + g_v * g_v)
        if steepness == 0:
            break
        if g_uu > 0 and determinant > 0:
            du, dv = (g_uv * g_v - g_vv * g_u) / determinant, (g_uv * g_u - g_uu * g_v) / determinant
        else:
            du, dv = -reach * g_u / steepness, -reach * g_v / steepness
        size = math.sqrt(du * du + dv * dv)
        if gap + SPARE_FALL * (g_u * du + g_v * dv) / 2 > level and g_uu > 0 and determinant > 0:
            break
        if size > reach:
            du, dv = du * reach / size, dv * reach / size
        share = _share(edges, u, v, du, dv, slack, -1)
        if share * min(size, reach) <= slack:
            du, dv = _slide(edges, u, v, du, dv, (g_u, g_v, g_uu, g_uv, g_vv), reach, slack)
            share = 1.0
        u, v = u + share * du, v + share * dv
        if share == 1 and du * du + dv * dv < (STEP_SHARE * reach) ** 2:
            break


@inner
def _is_over(edges, first, end, u, v, slack):  # type: ignore[no-untyped-def]
    """Return whether coordinates lie within the rim of the edges from `first` to `end`, or outside it by at most a slack."""
    is_inside = False
    for e in range(first, end):
        x, y = u - edges[e, 0], v - edges[e, 1]
        along, across = x * edges[e, 2] + y * edges[e, 3], x * edges[e, 5] + y * edges[e, 6]
        beyond = along - min(max(along, 0.0), edges[e, 4])
        if beyond * beyond + across * across <= slack * slack:
            return True
        below, above = -y, edges[e, 3] * edges[e, 4] - y
        if (below > 0) != (above > 0):
            crossing = edges[e, 0] + edges[e, 2] * edges[e, 4] * below / (below - above)
            is_inside = is_inside != (crossing > u)
    return is_inside


@compiled
def choose_starts(points, gaps, limits, distance, starts):  # type: ignore[no-untyped-def]
    """Write the indices (n, start) of the points with the smallest gaps, at least a distance [mm] apart; -1 for none.

    points   (n, point, 3) [mm], or (1, point, 3) if they are the same in all rows
    gaps     (n, point) [mm]
    limits   (n,) [mm]: larger gaps do not count
    """
    nearby, order = np.empty(gaps.shape[1], dtype=np.int64), np.empty(gaps.shape[1])
    for k in range(gaps.shape[0]):
        row_points, count, start_count = points[k % points.shape[0]], 0, 0
        for p in range(gaps.shape[1]):
            if gaps[k, p] < limits[k]:
                nearby[count], order[count], count = p, gaps[k, p], count + 1
        while start_count < starts.shape[1]:
            least_gap, start = np.inf, -1
            for c in range(count):
                if order[c] < least_gap:
                    least_gap, start = order[c], nearby[c]
            if start < 0:
                break
            starts[k, start_count], start_count = start, start_count + 1
            for c in range(count):
                square = 0.0
                for i in range(3):
                    square += (row_points[nearby[c], i] - row_points[start, i]) ** 2
                if square <= distance * distance:
                    order[c] = np.inf
        starts[k, start_count:] = -1


@compiled
def find_minima(moving, reference, poses, sums_m, sums_r, grown, points, starts, reach, slack, depth, labels):  # type: ignore
    """Write the labels (n, point) of the deepest local minima of the gap that are deeper than `depth` [mm]; -1 for none.

    sums_m, sums_r   HeightSums of both planes
    grown    (n,) [mm]: the sum of the outward offsets of both faces
    points   (n, point, 3) [mm] of the moving plane, or (1, point, 3) if they are the same at all poses
    starts   (n, start): indices of the starting points of searches for minima; -1 for none
    reach    [mm]: longest step of the search
    slack    [mm]: largest distance of a start outside a rim
    """
    along, weights, scratch, best = np.empty((3, 3)), np.empty((6, 4)), np.empty(5), np.empty(3)
    count = moving.edges.shape[0]
    edges, minima = np.empty((count + reference.edges.shape[0], 7)), np.empty((labels.shape[1], 3))
    ends = np.empty((starts.shape[1], 2))
    for k in range(poses.shape[0]):
        write_map(moving, reference, poses[k], along)
        are_edges_known, minimum_count, searches = False, 0, 0
        for s in range(starts.shape[1]):
            if starts[k, s] < 0:
                break
            if not are_edges_known:
                _write_edges(moving, reference, along, edges)
                are_edges_known = True
            u, v = coordinates(moving, points[k % points.shape[0], starts[k, s]])
            is_near = False
            for e in range(searches):
                is_near = is_near or (ends[e, 0] - u) ** 2 + (ends[e, 1] - v) ** 2 < (BASIN_SHARE * reach) ** 2
            if is_near:
                continue
            if not (_is_over(edges, 0, count, u, v, slack) and _is_over(edges, count, edges.shape[0], u, v, slack)):
                continue
            level = grown[k] - depth
            _descend(moving, reference, sums_m, sums_r, k, along, edges, u, v, reach, level, weights, scratch, best)
            ends[searches, 0], ends[searches, 1], searches = best[0], best[1], searches + 1
            best[2] -= grown[k]
            if not best[2] < -depth:
                continue
            is_known = False
            for m in range(minimum_count):
                distance = (minima[m, 0] - best[0]) ** 2 + (minima[m, 1] - best[1]) ** 2
                is_known = is_known or distance < (NEAR_SHARE * reach) ** 2
            if is_known or (minimum_count == labels.shape[1] and best[2] >= minima[minimum_count - 1, 2]):
                continue
            m = min(minimum_count, labels.shape[1] - 1)
            while m > 0 and minima[m - 1, 2] > best[2]:
                minima[m] = minima[m - 1]
                m -= 1
            minima[m], minimum_count = best, min(minimum_count + 1, labels.shape[1])
        for m in range(labels.shape[1]):
            labels[k, m] = _label(moving, minima[m, 0], minima[m, 1]) if m < minimum_count else -1


@compiled
def join(labels, former, joined):  # type: ignore[no-untyped-def]
    """Write labels (n, a), then further former labels (n, b), then -1 to joined (n, c); return the largest count of a row."""
    largest_count = 0
    for k in range(labels.shape[0]):
        count = 0
        for group in (labels, former):
            for c in range(group.shape[1]):
                label, is_new = group[k, c], group[k, c] >= 0 and count < joined.shape[1]
                for j in range(count):
                    is_new = is_new and joined[k, j] != label
                if is_new:
                    joined[k, count], count = label, count + 1
        joined[k, count:] = -1
        largest_count = max(largest_count, count)
    return largest_count


@inner
def _label(plane, u, v):  # type: ignore[no-untyped-def]
    """Return the label of a point on a plane: its coordinates in whole cells."""
    low, high = plane.corners[0], plane.corners[1]
    i = min(max(int((u - low[0]) / (high[0] - low[0]) * CELLS), 0), CELLS - 1)
    j = min(max(int((v - low[1]) / (high[1] - low[1]) * CELLS), 0), CELLS - 1)
    return FIRST_PLACE + i * CELLS + j


@compiled
def write_places(moving, reference, poses, sums_m, sums_r, labels, slack, places, projections, gaps, heights):  # type: ignore
    """Write the points (n, point, 3) of labels, their projections, nominal gaps (n, point), and sums of both heights [mm].

    The gap of a label -1 is infinite, and so is the gap of a point that overhangs a face by more than a slack.
    """
    along, weights, scratch = np.empty((3, 3)), np.empty((6, 4)), np.empty(5)
    low, high, count = moving.corners[0], moving.corners[1], moving.edges.shape[0]
    edges = np.empty((count + reference.edges.shape[0], 7))
    for k in range(poses.shape[0]):
        are_edges_known = False
        for p in range(labels.shape[1]):
            gaps[k, p], heights[k, p] = np.inf, 0.0
            if labels[k, p] < FIRST_PLACE:
                continue
            if not are_edges_known:
                write_map(moving, reference, poses[k], along)
                _write_edges(moving, reference, along, edges)
                are_edges_known = True
            cell = labels[k, p] - FIRST_PLACE
            u = low[0] + (cell // CELLS + 0.5) / CELLS * (high[0] - low[0])
            v = low[1] + (cell % CELLS + 0.5) / CELLS * (high[1] - low[1])
            x = along[0, 0] * u + along[0, 1] * v + along[0, 2]
            y = along[1, 0] * u + along[1, 1] * v + along[1, 2]
            for i in range(3):
                places[k, p, i] = moving.origin[i] + u * moving.axes[0, i] + v * moving.axes[1, i]
                projections[k, p, i] = reference.origin[i] + x * reference.axes[0, i] + y * reference.axes[1, i]
            if _is_over(edges, count, edges.shape[0], u, v, slack):
                gap = gap_at(moving, reference, sums_m, sums_r, k, along, u, v, weights, scratch)
                gaps[k, p] = along[2, 0] * u + along[2, 1] * v + along[2, 2]
                heights[k, p] = gaps[k, p] - gap
