"""Cut a closed polyhedron into convex pieces, along the planes of its own facets."""

from collections.abc import Iterator

import numpy as np
import trimesh
from scipy.optimize import linprog
from scipy.spatial import HalfspaceIntersection

from studies.certificates.polyhedra import Polyhedron

ROUNDING = 1e-9  # of the size


def convex_pieces(mesh: trimesh.Trimesh) -> list[Polyhedron]:
    """Return convex pieces whose union is a closed body. Cells in which no facet is left lie inside it, or outside."""
    lower, upper = mesh.bounds
    box = np.concatenate([np.column_stack([np.eye(3), -upper]), np.column_stack([-np.eye(3), lower])])
    return [
        Polyhedron(corners)
        for corners in cells(box, np.asarray(mesh.triangles), float(mesh.scale))
        if _is_inside(mesh, corners)
    ]


def cells(halfspaces: np.ndarray, triangles: np.ndarray, size: float) -> Iterator[np.ndarray]:
    """Yield corners (corner, 3) of the cells of a convex region, a x + b <= 0 (halfspace, 4), without facets inside."""
    centre, radius = _largest_ball(halfspaces)
    if radius < ROUNDING * size:
        return
    left, planes = [], []
    for triangle in triangles:
        inside, plane = _clipped(triangle, halfspaces, ROUNDING * size), _plane(triangle)
        if len(inside) > 2 and not (np.abs(halfspaces - plane).max(axis=1) < 1e-7 * max(size, 1)).any():
            left.append(triangle)
            planes.append(plane)
    planes = [plane for plane in planes if not (np.abs(halfspaces + plane).max(axis=1) < 1e-7 * max(size, 1)).any()]
    if not planes:
        yield HalfspaceIntersection(halfspaces, centre).intersections
        return
    # The plane that most facets lie in leaves the fewest cells.
    keys = np.round(np.array(planes) / np.array([1, 1, 1, size]), 7)
    _, first, count = np.unique(keys, axis=0, return_index=True, return_counts=True)
    plane = planes[first[count.argmax()]]
    for side in (plane, -plane):
        yield from cells(np.vstack([halfspaces, side]), np.array(left), size)


def _plane(triangle: np.ndarray) -> np.ndarray:
    n = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    n /= np.linalg.norm(n)
    return np.append(n, -n @ triangle[0])


def _largest_ball(halfspaces: np.ndarray) -> tuple[np.ndarray, float]:
    A = np.column_stack([halfspaces[:, :3], np.ones(len(halfspaces))])
    found = linprog([0, 0, 0, -1], A_ub=A, b_ub=-halfspaces[:, 3], bounds=[(None, None)] * 3 + [(0, None)], method="highs")
    return (found.x[:3], float(found.x[3])) if found.status == 0 else (np.zeros(3), 0.0)


def _clipped(polygon: np.ndarray, halfspaces: np.ndarray, slack: float) -> np.ndarray:
    """Return the part (corner, 3) of a polygon that lies inside half-spaces by more than `slack`."""
    for a in halfspaces:
        heights = polygon @ a[:3] + a[3] + slack
        kept = list[np.ndarray]()
        for k, height in enumerate(heights):
            before = heights[k - 1]
            if (height < 0) != (before < 0):
                kept.append(polygon[k - 1] + (polygon[k] - polygon[k - 1]) * before / (before - height))
            if height < 0:
                kept.append(polygon[k])
        polygon = np.array(kept).reshape(-1, 3)
        if not len(polygon):
            break
    return polygon


def _is_inside(mesh: trimesh.Trimesh, corners: np.ndarray) -> bool:
    """Return whether the centre of a cell lies inside a body: the solid angle of its triangles is a full one."""
    a, b, c = (np.asarray(mesh.triangles)[:, k] - corners.mean(axis=0) for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    numerator = np.einsum("ij,ij->i", a, np.cross(b, c))
    denominator = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return bool(np.arctan2(numerator, denominator).sum() > np.pi)
