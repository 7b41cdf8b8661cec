"""Bodies of many triangles are drawn with fewer: a page has to be sent, and turned."""

from collections.abc import Sequence

import fast_simplification
import igl
import numpy as np
from scipy.spatial import cKDTree

TRIANGLES = 60_000  # of all bodies together
LEAST = 500  # of a body
ENOUGH = 1.2  # times as many as wanted


def allowed(counts: Sequence[int]) -> list[int]:
    """How many triangles each body may have."""
    share = min(1.0, TRIANGLES / max(sum(counts), 1))
    return [count if share == 1 else min(count, max(LEAST, int(share * count))) for count in counts]


def coarser(vertices: np.ndarray, faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A surface of `count` triangles, about: vertices (vertex, 3), faces (face, 3), and the vertex of before next to each."""
    if len(faces) <= count:
        return vertices, faces, np.arange(len(vertices))
    found, corners = fast_simplification.simplify(vertices, faces, target_count=count)
    if len(corners) > ENOUGH * count:  # it stops where many edges are short; this one merges the shortest, but takes longer
        found, corners, *_ = igl.decimate(
            np.asarray(vertices, dtype=np.float64, order="C"), np.asarray(faces, dtype=np.int64, order="C"), count
        )
    return found, corners, cKDTree(vertices).query(found)[1]
