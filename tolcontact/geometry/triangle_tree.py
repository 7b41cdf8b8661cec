"""The search tree of triangles, for nearest points."""

import igl
import numpy as np


def triangle_tree(vertices: np.ndarray, faces: np.ndarray) -> igl.AABB:
    """Return the search tree of triangles: vertices (vertex, 3) [mm] and faces (face, 3), both contiguous."""
    tree = igl.AABB()
    tree.init(vertices, faces)
    return tree
