"""Contact points on a surface: spread evenly, by number or by spacing, or the mesh's own vertices (paper, 2.2)."""

import numpy as np
import trimesh

CANDIDATES_PER_SPACING = 2.0


def spread(surface: trimesh.Trimesh, count: int | None, spacing: float | None) -> np.ndarray:
    """Points on `surface`, shape (point, 3) [mm], each as far as possible from those before it.

    Farthest-point order over a fine subdivision of the triangles: corners and rims come first, the tessellation
    does not show, and the same surface always gives the same points. `count` points, or as many as it takes until
    every spot is within `spacing` [mm] of one.
    """
    step = spacing if spacing is not None else float(np.sqrt(surface.area / count))  # type: ignore[operator]
    vertices, _ = trimesh.remesh.subdivide_to_size(
        surface.vertices, surface.faces, max_edge=step / CANDIDATES_PER_SPACING, max_iter=30
    )
    candidates = np.asarray(vertices)
    centre = (candidates.min(axis=0) + candidates.max(axis=0)) / 2
    chosen = [int(np.argmax(((candidates - centre) ** 2).sum(axis=1)))]
    distance2 = ((candidates - candidates[chosen[0]]) ** 2).sum(axis=1)
    while True:
        farthest = int(np.argmax(distance2))
        if (len(chosen) == count) if spacing is None else (distance2[farthest] <= spacing**2):
            return candidates[chosen]
        chosen.append(farthest)
        np.minimum(distance2, ((candidates - candidates[farthest]) ** 2).sum(axis=1), out=distance2)


def own_vertices(surface: trimesh.Trimesh) -> np.ndarray:
    """The vertices of the surface's triangles, each once, shape (point, 3) [mm]."""
    return np.unique(np.asarray(surface.vertices), axis=0)
