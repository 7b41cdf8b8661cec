"""Contact points on a surface: spread evenly, by number or by spacing, or the mesh's own vertices (paper, 2.2)."""

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from tolcontact.geometry.edges import rim

CANDIDATES_PER_SPACING = 2.0
CROWD = 50  # candidates for each point, from which on some are left out
BLOCK = 512  # candidates
CORNER_ANGLE = np.radians(30.0)


def spread(surface: trimesh.Trimesh, count: int | None, spacing: float | None) -> np.ndarray:
    """Points on `surface`, shape (point, 3) [mm], each as far as possible from those before it.

    Farthest-point order over a fine subdivision of the triangles, from the corners of the rim on, where contact comes
    first: the tessellation does not show, and the same surface always gives the same points. `count` points, or as
    many as it takes until every spot is within `spacing` [mm] of one.
    """
    step = spacing if spacing is not None else float(np.sqrt(surface.area / count))  # type: ignore[operator]
    vertices, faces = trimesh.remesh.subdivide_to_size(
        surface.vertices, surface.faces, max_edge=step / CANDIDATES_PER_SPACING, max_iter=30
    )
    candidates = np.asarray(vertices)
    if len(candidates) > CROWD * max(surface.area / step**2, 1):
        candidates = _thinned(candidates, np.asarray(faces), step / (2 * CANDIDATES_PER_SPACING))
    centre = (candidates.min(axis=0) + candidates.max(axis=0)) / 2
    chosen = _apart(_rim_corners(surface), step / CANDIDATES_PER_SPACING)
    if not chosen or (count is not None and len(chosen) > count):
        chosen = [candidates[np.argmax(((candidates - centre) ** 2).sum(axis=1))]]
    distance2 = np.min([((candidates - point) ** 2).sum(axis=1) for point in chosen], axis=0)
    tree = cKDTree(candidates)
    # Of many candidates the farthest is looked for among the farthest of each block: few blocks change with a point.
    blocks = np.full((-(-len(candidates) // BLOCK), BLOCK), -1.0)
    distances = blocks.reshape(-1)[: len(candidates)]
    distances[:] = distance2
    largest = blocks.max(axis=1)
    while True:
        block = int(np.argmax(largest))
        farthest = BLOCK * block + int(np.argmax(blocks[block]))
        if (len(chosen) == count) if spacing is None else (distances[farthest] <= spacing**2):
            return np.array(chosen)
        chosen.append(candidates[farthest])
        # No candidate is farther than this one from those chosen, so that it changes nothing beyond that distance.
        near = tree.query_ball_point(candidates[farthest], np.sqrt(distances[farthest]) * (1 + 1e-9), return_sorted=False)
        near = np.asarray(near)
        distances[near] = np.minimum(distances[near], ((candidates[near] - candidates[farthest]) ** 2).sum(axis=1))
        changed = np.flatnonzero(np.bincount(near // BLOCK, minlength=len(blocks)))
        largest[changed] = blocks[changed].max(axis=1)


def _thinned(points: np.ndarray, faces: np.ndarray, cell: float) -> np.ndarray:
    """One of the points (point, 3) in each cube of side `cell` [mm], on the rim where one is."""
    inner = np.ones(len(points), dtype=bool)
    inner[rim(faces).ravel()] = False
    points = points[np.argsort(inner, kind="stable")]
    first, _ = trimesh.grouping.unique_rows(np.floor(points / cell).astype(np.int64))
    return np.asarray(points[np.sort(first)])


def _apart(points: np.ndarray, least: float) -> list[np.ndarray]:
    """Those of the points (point, 3) that stand `least` [mm] or more from those before: a jagged rim has no corners."""
    chosen: list[np.ndarray] = []
    for point in points:
        if all(((point - other) ** 2).sum() >= least**2 for other in chosen):
            chosen.append(point)
    return chosen


def _rim_corners(surface: trimesh.Trimesh) -> np.ndarray:
    """Vertices (corner, 3) at which the rim of an open surface turns by more than CORNER_ANGLE."""
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


def own_vertices(surface: trimesh.Trimesh) -> np.ndarray:
    """The vertices of the surface's triangles, each once, shape (point, 3) [mm]."""
    return np.unique(np.asarray(surface.vertices), axis=0)
