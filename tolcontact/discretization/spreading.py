"""Contact points on a surface: spread evenly, by number or by spacing, or the mesh's own vertices (paper, 2.2)."""

import numpy as np
import trimesh

CANDIDATES_PER_SPACING = 2.0
CORNER_ANGLE = np.radians(30.0)


def spread(surface: trimesh.Trimesh, count: int | None, spacing: float | None) -> np.ndarray:
    """Points on `surface`, shape (point, 3) [mm], each as far as possible from those before it.

    Farthest-point order over a fine subdivision of the triangles, from the corners of the rim on, where contact comes
    first: the tessellation does not show, and the same surface always gives the same points. `count` points, or as
    many as it takes until every spot is within `spacing` [mm] of one.
    """
    step = spacing if spacing is not None else float(np.sqrt(surface.area / count))  # type: ignore[operator]
    vertices, _ = trimesh.remesh.subdivide_to_size(
        surface.vertices, surface.faces, max_edge=step / CANDIDATES_PER_SPACING, max_iter=30
    )
    candidates = np.asarray(vertices)
    centre = (candidates.min(axis=0) + candidates.max(axis=0)) / 2
    chosen = list(_rim_corners(surface))
    if not chosen or (count is not None and len(chosen) > count):
        chosen = [candidates[np.argmax(((candidates - centre) ** 2).sum(axis=1))]]
    distance2 = np.min([((candidates - point) ** 2).sum(axis=1) for point in chosen], axis=0)
    while True:
        farthest = int(np.argmax(distance2))
        if (len(chosen) == count) if spacing is None else (distance2[farthest] <= spacing**2):
            return np.array(chosen)
        chosen.append(candidates[farthest])
        np.minimum(distance2, ((candidates - candidates[farthest]) ** 2).sum(axis=1), out=distance2)


def _rim_corners(surface: trimesh.Trimesh) -> np.ndarray:
    """Vertices (corner, 3) at which the rim of an open surface turns by more than CORNER_ANGLE."""
    edges, counts = np.unique(np.sort(surface.edges, axis=1), axis=0, return_counts=True)
    start, end = edges[counts == 1].T
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
