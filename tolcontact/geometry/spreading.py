"""Contact points on a surface: spread evenly, by count or by spacing (paper, 2.2), or added where faces are curved.

The frame of a face rotates with the face, so that comparisons in it do not depend on the pose of the face.

Between two contact points of a curved face the other part can penetrate by the height of the arc over their chord. Along a
straight generator it cannot, however long the chord. So triangles of the moving face are halved across the edge whose midpoint
is deepest below the line between its ends, as seen from the reference face, until no midpoint is too deep.
"""

from typing import NamedTuple

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from tolcontact.geometry.surface import Surface
from tolcontact.geometry.tolerances import ROUNDING, SAME_DIRECTION
from tolcontact.geometry.triangle_mesh import rim, subdivided

TIE = 1e-6  # relative difference of lengths that are equal except for rounding
CELLS = 2.0**30  # in a length of about the face's size: coordinates are whole numbers of cells
OFF_POWER = 1.1  # keeps the sizes of usual faces off powers of 2, between which the size of cells doubles
CANDIDATES_PER_SPACING = 2.0
MAX_CANDIDATES_PER_POINT = 50  # above this, candidates are thinned out
BLOCK_CANDIDATES = 512
CORNER_ANGLE = np.radians(30.0)
CHORD_SHARE = 5e-4  # of the smallest tolerance range: permitted penetration between points
MAX_HALVINGS = 40
MAX_POINTS = 5000  # added because of curvature
MAX_TRIANGLES = 30_000  # at which halving stops
FIRST_PIECES = 4  # number of initial triangles across the smaller face
MOVES = 1500  # random displacements for comparing sets of points
MOVES_PER_BLOCK = 500
SMALLEST_MOVE = 0.1  # of the smallest tolerance range


class FaceFrame(NamedTuple):
    """A centre (3,) [mm], unit vectors (3, 3) in columns, and the size [mm] of the cells for rounding coordinates."""

    centre: np.ndarray
    axes: np.ndarray
    cell: float
    rounds: bool = True

    def coordinates(self, points: np.ndarray) -> np.ndarray:
        """Return the coordinates (point, 3) [cell] of points (point, 3) [mm], optionally rounded to hide earlier rounding."""
        coordinates = (points - self.centre) @ self.axes / self.cell
        return np.round(coordinates) if self.rounds else coordinates

    def subdivided(self, vertices: np.ndarray, faces: np.ndarray, max_edge: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return vertices (vertex, 3) [mm], faces (face, 3) with edges of at most `max_edge` [mm], and coordinates (vertex, 3).

        Only the coordinates [cell] decide which edges are halved.
        """
        rows = np.hstack([self.coordinates(vertices), vertices])
        rows, faces, _ = subdivided(rows, faces, max_edge / self.cell)
        return np.ascontiguousarray(rows[:, 3:]), faces, np.ascontiguousarray(rows[:, :3])


PART_FRAME = FaceFrame(np.zeros(3), np.eye(3), 1.0, rounds=False)


def face_frame(mesh: trimesh.Trimesh) -> FaceFrame:
    """Return the frame of the triangles of a face.

    Its origin is the centroid of the area. The first axis is along the longest edge of the rim, or of the triangles of a closed
    face; the second points towards the corner that is farthest from the first. Where several are equal, as on symmetric
    faces, the first in the order of the triangles is used.
    """
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    triangles = vertices[faces]
    areas = trimesh.triangles.area(triangles)
    centre = areas @ triangles.mean(axis=1) / areas.sum()
    ends = vertices[rim(faces)] if len(rim(faces)) else triangles[:, :2]
    u = _longest(ends[:, 1] - ends[:, 0])
    u /= np.linalg.norm(u)
    offsets = triangles.reshape(-1, 3) - centre
    v = _longest(offsets - (offsets @ u)[:, None] * u)
    v /= np.linalg.norm(v)
    size = 2.0 ** np.floor(np.log2(OFF_POWER * np.linalg.norm(offsets, axis=1).max()))
    return FaceFrame(centre, np.stack([u, v, np.cross(u, v)], axis=1), size / CELLS)


def _longest(vectors: np.ndarray) -> np.ndarray:
    """Return the first (3,) of the longest vectors (vector, 3)."""
    lengths = np.linalg.norm(vectors, axis=1)
    return np.array(vectors[np.argmax(lengths >= (1 - TIE) * lengths.max())])


def spread(surface: trimesh.Trimesh, count: int | None, spacing: float | None) -> np.ndarray:
    """Return points (point, 3) [mm] on `surface`, each as far as possible from the previous points.

    There are `count` points, or enough points that none of the surface is further than `spacing` [mm] from one. They start with
    the corners of the rim, where contact occurs first, and continue in farthest-point order over a fine subdivision of the
    triangles. On a flat face distances are compared in its own frame, so that a rotated face keeps its points. On a curved face
    equal distances differ by rounding: points in straight rows would let a shaft roll between them.
    """
    step = spacing if spacing is not None else float(np.sqrt(surface.area / count))  # type: ignore[operator]
    is_flat = np.ptp(np.asarray(surface.face_normals), axis=0).max() < SAME_DIRECTION
    frame = face_frame(surface) if is_flat else PART_FRAME
    vertices, faces, candidates = frame.subdivided(surface.vertices, surface.faces, step / CANDIDATES_PER_SPACING)
    if len(candidates) > MAX_CANDIDATES_PER_POINT * max(surface.area / step**2, 1):
        thinned = _thinned(candidates, faces, step / (2 * CANDIDATES_PER_SPACING) / frame.cell)
        vertices, candidates = vertices[thinned], candidates[thinned]
    coordinates = frame.coordinates(surface.vertices)
    corners = np.flatnonzero(_are_corners(coordinates, np.asarray(surface.faces)))
    corners = corners[_separated(coordinates[corners], step / CANDIDATES_PER_SPACING / frame.cell)]
    if not len(corners) or (count is not None and len(corners) > count):
        centre = (candidates.min(axis=0) + candidates.max(axis=0)) / 2
        numbers = [int(np.argmax(((candidates - centre) ** 2).sum(axis=1)))]
    else:
        vertices, candidates = np.vstack([surface.vertices[corners], vertices]), np.vstack([coordinates[corners], candidates])
        numbers = list(range(len(corners)))
    numbers = _farthest(candidates, numbers, count, None if spacing is None else spacing / frame.cell)
    return np.asarray(vertices)[numbers]


def _farthest(candidates: np.ndarray, numbers: list[int], count: int | None, spacing: float | None) -> list[int]:
    """Return the indices of candidates (candidate, 3), `numbers` first, each as far as possible from the previous ones."""
    numbers = list(numbers)
    distance2 = np.min([((candidates - candidates[number]) ** 2).sum(axis=1) for number in numbers], axis=0)
    tree = cKDTree(candidates)
    # The farthest candidate is the maximum over the blocks' farthest candidates: a new point changes few blocks.
    blocks = np.full((-(-len(candidates) // BLOCK_CANDIDATES), BLOCK_CANDIDATES), -1.0)
    distances = blocks.reshape(-1)[: len(candidates)]
    distances[:] = distance2
    largest = blocks.max(axis=1)
    while True:
        block = int(np.argmax(largest))
        farthest = BLOCK_CANDIDATES * block + int(np.argmax(blocks[block]))
        if (len(numbers) == count) if spacing is None else (distances[farthest] <= spacing**2):
            return numbers
        numbers.append(farthest)
        # No candidate is further from the points than this one, so it changes nothing beyond that distance.
        reach = np.sqrt(distances[farthest]) * (1 + 1e-9)
        neighbours = np.asarray(tree.query_ball_point(candidates[farthest], reach, return_sorted=False))
        distance2 = ((candidates[neighbours] - candidates[farthest]) ** 2).sum(axis=1)
        distances[neighbours] = np.minimum(distances[neighbours], distance2)
        changed = np.flatnonzero(np.bincount(neighbours // BLOCK_CANDIDATES, minlength=len(blocks)))
        largest[changed] = blocks[changed].max(axis=1)


def _thinned(points: np.ndarray, faces: np.ndarray, cell: float) -> np.ndarray:
    """Return the index of one of the points (point, 3) in each cube of side `cell`, if possible a point on the rim."""
    inner = np.ones(len(points), dtype=bool)
    inner[rim(faces).ravel()] = False
    order = np.argsort(inner, kind="stable")
    unique, _ = trimesh.grouping.unique_rows(np.floor(points[order] / cell).astype(np.int64))
    return np.asarray(order[np.sort(unique)])


def _separated(points: np.ndarray, min_distance: float) -> list[int]:
    """Return the indices of points (point, 3) at least `min_distance` from earlier ones: corners of a jagged rim are merged."""
    separated: list[int] = []
    for number, point in enumerate(points):
        if all(((point - points[earlier]) ** 2).sum() >= min_distance**2 for earlier in separated):
            separated.append(number)
    return separated


def _are_corners(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return a mask (vertex,) of the vertices (vertex, 3) [cell] at which a rim turns by more than CORNER_ANGLE."""
    start, end = rim(faces).T
    along = vertices[end] - vertices[start]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1)  # edges shorter than a cell have no direction
    # Where the rim is straight, the unit vectors to both neighbours cancel.
    turn, rims = np.zeros_like(vertices), np.zeros(len(vertices))
    np.add.at(turn, start, along)
    np.add.at(turn, end, -along)
    np.add.at(rims, np.concatenate([start, end]), 1)
    return np.asarray((rims == 2) & (np.linalg.norm(turn, axis=1) > 2 * np.sin(CORNER_ANGLE / 2)))


def unique_points(points: np.ndarray) -> np.ndarray:
    """Return points (point, 3), each once, sorted by their coordinates. NumPy's `unique` takes several times as long."""
    points = points[np.lexsort(points.T[::-1])]
    is_new = np.append(True, (points[1:] != points[:-1]).any(axis=1))[: len(points)]
    return np.asarray(points[is_new])


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
            times += np.bincount((rows @ moves).argmin(axis=0), minlength=len(rows))
    order = np.argsort(-times, kind="stable")
    return order[times[order] > 0]
