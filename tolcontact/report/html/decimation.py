"""The decimation of large bodies, which keeps pages small and quick to draw."""

from collections.abc import Sequence

import fast_simplification
import igl
import numpy as np
from scipy.spatial import cKDTree

MAX_TRIANGLES = 60_000  # of all bodies
MIN_TRIANGLES = 500  # of a body
MAX_EXCESS = 1.2  # over the number of triangles that the fast method should reach


def triangle_budgets(counts: Sequence[int]) -> list[int]:
    """Return the largest number of triangles of each body."""
    share = min(1.0, MAX_TRIANGLES / max(sum(counts), 1))
    return [count if share == 1 else min(count, max(MIN_TRIANGLES, int(share * count))) for count in counts]


def coarser(vertices: np.ndarray, faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a surface of about `count` triangles: vertices (vertex, 3), faces (face, 3), and the nearest old vertices."""
    if len(faces) <= count:
        return vertices, faces, np.arange(len(vertices))
    coarse, corners = fast_simplification.simplify(vertices, faces, target_count=count)
    if len(corners) > MAX_EXCESS * count:  # short edges stop the fast method, not this one
        coarse, corners, *_ = igl.decimate(
            np.asarray(vertices, dtype=np.float64, order="C"), np.asarray(faces, dtype=np.int64, order="C"), count
        )
    return coarse, corners, cKDTree(vertices).query(coarse)[1]
