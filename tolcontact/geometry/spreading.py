"""Contact points on a surface: spread evenly, by number or by spacing, or the mesh's own vertices (paper, 2.2)."""

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from tolcontact.geometry.edges import rim

CANDIDATES_PER_SPACING = 2.0
MAX_CANDIDATES_PER_POINT = 50  # above which they are thinned out
BLOCK_CANDIDATES = 512
CORNER_ANGLE = np.radians(30.0)


def spread(surface: trimesh.Trimesh, count: int | None, spacing: float | None) -> np.ndarray:
    """Return points (point, 3) [mm] on `surface`, each as far as possible from the points before it.

    There are `count` points, or as many as bring every place within `spacing` [mm] of one. They begin with the corners of the
    rim, where contact comes first, and follow in farthest-point order over a fine subdivision of the triangles: they do not
    depend on the tessellation, and the same surface always has the same points.
    """
    step = spacing if spacing is not None else float(np.sqrt(surface.area / count))  # type: ignore[operator]
    vertices, faces = trimesh.remesh.subdivide_to_size(
        surface.vertices, surface.faces, max_edge=step / CANDIDATES_PER_SPACING, max_iter=30
    )
    candidates = np.asarray(vertices)
    if len(candidates) > MAX_CANDIDATES_PER_POINT * max(surface.area / step**2, 1):
        candidates = _thinned(candidates, np.asarray(faces), step / (2 * CANDIDATES_PER_SPACING))
    centre = (candidates.min(axis=0) + candidates.max(axis=0)) / 2
    points = _separated(_rim_corners(surface), step / CANDIDATES_PER_SPACING)
    if not points or (count is not None and len(points) > count):
        points = [candidates[np.argmax(((candidates - centre) ** 2).sum(axis=1))]]
    distance2 = np.min([((candidates - point) ** 2).sum(axis=1) for point in points], axis=0)
    tree = cKDTree(candidates)
    # The farthest of many candidates is the farthest of the farthest of each block: a point changes few blocks.
    blocks = np.full((-(-len(candidates) // BLOCK_CANDIDATES), BLOCK_CANDIDATES), -1.0)
    distances = blocks.reshape(-1)[: len(candidates)]
    distances[:] = distance2
    largest = blocks.max(axis=1)
    while True:
        block = int(np.argmax(largest))
        farthest = BLOCK_CANDIDATES * block + int(np.argmax(blocks[block]))
        if (len(points) == count) if spacing is None else (distances[farthest] <= spacing**2):
            return np.array(points)
        points.append(candidates[farthest])
        # No candidate is farther than this one from the points, so that it changes nothing beyond that distance.
        reach = np.sqrt(distances[farthest]) * (1 + 1e-9)
        neighbours = np.asarray(tree.query_ball_point(candidates[farthest], reach, return_sorted=False))
        distance2 = ((candidates[neighbours] - candidates[farthest]) ** 2).sum(axis=1)
        distances[neighbours] = np.minimum(distances[neighbours], distance2)
        changed = np.flatnonzero(np.bincount(neighbours // BLOCK_CANDIDATES, minlength=len(blocks)))
        largest[changed] = blocks[changed].max(axis=1)


def _thinned(points: np.ndarray, faces: np.ndarray, cell: float) -> np.ndarray:
    """Return one of the points (point, 3) in each cube of side `cell` [mm], one on the rim if possible."""
    inner = np.ones(len(points), dtype=bool)
    inner[rim(faces).ravel()] = False
    points = points[np.argsort(inner, kind="stable")]
    unique, _ = trimesh.grouping.unique_rows(np.floor(points / cell).astype(np.int64))
    return points[np.sort(unique)]


def _separated(points: np.ndarray, min_distance: float) -> list[np.ndarray]:
    """Return the points (point, 3) at least `min_distance` [mm] from those before: corners of a jagged rim are one."""
    separated: list[np.ndarray] = []
    for point in points:
        if all(((point - earlier) ** 2).sum() >= min_distance**2 for earlier in separated):
            separated.append(point)
    return separated


def _rim_corners(surface: trimesh.Trimesh) -> np.ndarray:
    """Return the vertices (corner, 3) at which the rim of an open surface turns by more than CORNER_ANGLE."""
    start, end = rim(surface.faces).T
    along = surface.vertices[end] - surface.vertices[start]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # Where the rim goes straight on, the unit vectors to both neighbours cancel.
    turn, rims = np.zeros_like(surface.vertices), np.zeros(len(surface.vertices))
    np.add.at(turn, start, along)
    np.add.at(turn, end, -along)
    np.add.at(rims, np.concatenate([start, end]), 1)
    corner = (rims == 2) & (np.linalg.norm(turn, axis=1) > 2 * np.sin(CORNER_ANGLE / 2))
    return np.asarray(surface.vertices[corner])


def distinct_vertices(surface: trimesh.Trimesh) -> np.ndarray:
    """Return the vertices of the surface's triangles, each once, shape (point, 3) [mm]."""
    return distinct(np.asarray(surface.vertices))


def distinct(points: np.ndarray) -> np.ndarray:
    """Return points (point, 3), each once, in the order of their coordinates. NumPy's `unique` takes several times as long."""
    points = points[np.lexsort(points.T[::-1])]
    is_new = np.append(True, (points[1:] != points[:-1]).any(axis=1))[: len(points)]
    return np.asarray(points[is_new])
