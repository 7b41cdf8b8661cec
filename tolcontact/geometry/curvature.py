"""Contact points that follow curvature, and the error of representing two faces by a set of points.

Between two contact points of a curved face the other part can penetrate by the height of the arc over their chord. Along a
straight generator it cannot, however long the chord. So triangles of the moving face are halved across the edge whose midpoint
is deepest below the line between its ends, as seen from the reference face, until no midpoint is too deep.
"""

import numpy as np

from tolcontact.geometry.surface import Surface
from tolcontact.geometry.tolerances import ROUNDING

CHORD_SHARE = 5e-4  # of the smallest tolerance range: permitted penetration between points
MAX_HALVINGS = 40
MAX_POINTS = 5000  # added because of curvature
MAX_TRIANGLES = 30_000  # at which halving stops
FIRST_PIECES = 4  # number of initial triangles across the smaller face
MOVES = 1500  # random displacements for comparing sets of points
MOVES_PER_BLOCK = 500
SMALLEST_MOVE = 0.1  # of the smallest tolerance range


def curvature_points(face: Surface, target: Surface, *, chord: float, within: float) -> np.ndarray:
    """Return points (point, 3) [mm] of a face, so dense that `target` cannot penetrate between them by more than `chord` [mm].

    Only points within `within` [mm] of the target are returned, at most MAX_POINTS. If there are more, the deepest points after
    random displacements are used; the seed is fixed.
    """
    points = distinct(_refined(face, target, chord, within).reshape(-1, 3), ROUNDING * face.mesh.scale)
    projections, normals, is_over = target.project(points)
    reached = is_over & (np.linalg.norm(points - projections, axis=1) <= within)
    points, projections, normals = points[reached], projections[reached], normals[reached]
    if len(points) > MAX_POINTS:
        order = _by_depth(_gap_rows(points, projections, normals), within, chord / CHORD_SHARE)
        points = points[order[:MAX_POINTS]]
    return points


def _refined(face: Surface, target: Surface, chord: float, within: float) -> np.ndarray:
    """Return the triangles (triangle, 3, 3) of a face, halved until the error of every edge is at most `chord` [mm]."""
    triangles = np.asarray(face.mesh.triangles)
    max_length = np.inf if target.is_flat else target.mesh.scale / FIRST_PIECES
    finished = [np.zeros((0, 3, 3))]
    for _ in range(MAX_HALVINGS):
        error = _edge_errors(triangles, target, chord, within, max_length)
        is_coarse = error.max(axis=1) > chord
        finished.append(triangles[~is_coarse])
        triangles = triangles[is_coarse]
        if not len(triangles) or sum(map(len, finished)) + len(triangles) > MAX_TRIANGLES:
            break
        triangles = _halved(triangles, error[is_coarse].argmax(axis=1))
    return np.concatenate([*finished, triangles])


def _edge_errors(triangles: np.ndarray, target: Surface, chord: float, within: float, max_length: float) -> np.ndarray:
    """Return the error (triangle, edge) [mm] of treating the gap to the target along an edge as linear.

    Edge j runs from corner j to corner j + 1. Edges further than `within` [mm] from the target have no error. The error of
    other edges longer than `max_length` [mm] is their length, since their ends say nothing about the gap between them.
    """
    gap, normal = _gaps_to(target, triangles)
    midpoint_gap, midpoint_normal = _gaps_to(target, (triangles + np.roll(triangles, -1, axis=1)) / 2)
    sag = (gap + np.roll(gap, -1, axis=1)) / 2 - midpoint_gap
    # Where both faces have the same curvature, the chord error only appears once they are displaced.
    displacement = np.abs(midpoint_gap) + chord / CHORD_SHARE
    turned = displacement * (1 - ((normal + np.roll(normal, -1, axis=1)) / 2 * midpoint_normal).sum(axis=2))
    length = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    is_near = midpoint_gap - length < within
    error = np.where(is_near, np.maximum(sag, turned), 0)
    return np.where(is_near & (length > max_length), np.maximum(error, length), error)


def _halved(triangles: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Return the halves of `triangles` (triangle, 3, 3), each cut through the midpoint of its edge `edge` (triangle,)."""
    rows = np.arange(len(triangles))
    a, b, c = (triangles[rows, (edge + k) % 3] for k in range(3))
    midpoint = (a + b) / 2
    return np.concatenate([np.stack([a, midpoint, c], axis=1), np.stack([midpoint, b, c], axis=1)])


def _gaps_to(target: Surface, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gaps (triangle, 3) [mm] of points (triangle, 3, 3) to the target, and its normals there (triangle, 3, 3)."""
    points = positions.reshape(-1, 3)
    projections, normals, _ = target.project(points)
    gaps = ((points - projections) * normals).sum(axis=1)
    return gaps.reshape(-1, 3), normals.reshape(-1, 3, 3)


def sampling_error(sample: np.ndarray, points: np.ndarray, target: Surface, *, unit: float, within: float) -> float:
    """Return the possible penetration [mm] of `target` between the points `sample` (point, 3), judged by `points`.

    It is the 95 % quantile, over random small displacements, of the depth of the deepest of `points` below the deepest of
    `sample`. `unit` [mm] is the smallest tolerance range.
    """
    all_points = np.concatenate([sample, points])
    projections, normals, is_over = target.project(all_points)
    rows = _gap_rows(all_points, projections, normals)
    in_sample = np.arange(len(all_points)) < len(sample)
    differences = []
    for moves in _moves(within, unit, seed=1):
        gaps = rows @ moves
        sampled, dense = (np.where((is_over & mask)[:, None], gaps, np.inf).min(axis=0) for mask in (in_sample, ~in_sample))
        is_finite = np.isfinite(sampled) & np.isfinite(dense)
        differences.append((sampled - dense)[is_finite])
    depth = np.concatenate(differences)
    return max(0.0, float(np.quantile(depth, 0.95))) if depth.size else 0.0


def facet_error(moving: Surface, reference: Surface, within: float) -> float:
    """Return the distance [mm] of the flat triangles of two faces from the round surfaces that they approximate.

    Only triangles within `within` [mm] of the other face count. The height of an arc over its chord is the length of the chord
    times the arc angle / 8. The error of triangles that approximate an analytic surface is its residual.
    """
    total = 0.0
    for face, opposite in ((moving, reference), (reference, moving)):
        total += max((surface.residual for surface in face.surfaces), default=0.0)
        general = face.unknown
        if len(general.mesh.faces):
            height, length = general.chords
            _, nearest = opposite.nearest(general.mesh.triangles_center)
            distance = np.linalg.norm(general.mesh.triangles_center - nearest, axis=1) - length
            total += float(height.max(where=distance < within, initial=0.0))
    return total


def distinct(points: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the points (point, 3) without repetitions of earlier points within `tolerance` [mm], in their order."""
    # Cells are counted from one of the points: far from the origin their indices would be too large.
    cells = np.round((points - points[:1]) / tolerance).astype(np.int64)
    _, start = np.unique(cells, axis=0, return_index=True)
    return points[np.sort(start)]


def _gap_rows(points: np.ndarray, projections: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return gaps as functions of small displacements (t, r): rows (point, 7) of n, lever, and the initial gap [mm]."""
    centre = points.mean(axis=0)
    length = max(float(np.linalg.norm(points - centre, axis=1).max()), 1e-300)
    lever = np.cross(points - centre, normals) / length
    return np.column_stack([normals, lever, ((points - projections) * normals).sum(axis=1)])


def _moves(within: float, unit: float, seed: int) -> list[np.ndarray]:
    """Return random displacements (7, move), the last entry 1, of sizes between a share of `unit` and `within` [mm]."""
    rng = np.random.default_rng(seed)
    smallest = min(SMALLEST_MOVE * unit, within)
    blocks = []
    for _ in range(MOVES // MOVES_PER_BLOCK):
        direction = rng.normal(size=(6, MOVES_PER_BLOCK))
        direction /= np.linalg.norm(direction, axis=0)
        size = np.exp(rng.uniform(np.log(smallest), np.log(within), MOVES_PER_BLOCK))
        blocks.append(np.vstack([size * direction, np.ones(MOVES_PER_BLOCK)]))
    return blocks


def _by_depth(rows: np.ndarray, within: float, unit: float) -> np.ndarray:
    """Return the indices of the points that are the deepest after some displacement, most frequent first."""
    times = np.zeros(len(rows), dtype=int)
    for seed in (2, 3):
        for moves in _moves(within, unit, seed):
            depths = moves.T @ rows.T  # the minimum along rows of memory takes a fraction of the time
            times += np.bincount(depths.argmin(axis=1), minlength=len(rows))
    order = np.argsort(-times, kind="stable")
    return order[times[order] > 0]
