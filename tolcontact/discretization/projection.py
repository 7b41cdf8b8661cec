"""Nearest points of a reference surface (paper, 2.2)."""

import igl
import numpy as np
import trimesh


class Surface:
    """A surface, ready to be asked for its nearest points as often as need be."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self.mesh = mesh
        self._vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
        self._faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)
        self._tree = igl.AABB()
        self._tree.init(self._vertices, self._faces)
        # The smooth normals' weights are the facets' angles at each vertex, so that they do not depend on the triangulation.
        self._smooth = np.asarray(mesh.vertex_normals, dtype=np.float64)
        self._is_rim = _rims(mesh)

    def project(
        self, points: np.ndarray, *, smooth: bool = False, margin: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Project `points` (point, 3) [mm] onto the surface.

        Returns the nearest points (point, 3) [mm], the outward unit normals there (point, 3), and a mask (point,) of the
        points that lie over the surface, that is do not overhang its rim by more than `margin` [mm]. Normals are those of
        the facets; `smooth` interpolates between those at the vertices, so that they change steadily as a point moves.
        """
        _, triangle, nearest = self._tree.squared_distance(
            self._vertices, self._faces, np.ascontiguousarray(points, dtype=np.float64)
        )
        facet = np.asarray(self.mesh.face_normals)[triangle]
        offset = points - nearest
        sideways = np.linalg.norm(offset - (offset * facet).sum(axis=1, keepdims=True) * facet, axis=1)
        barycentric = trimesh.triangles.points_to_barycentric(self.mesh.triangles[triangle], nearest)
        # Edge j of a triangle runs from corner j to corner j+1, so it faces corner j+2: there that coordinate is zero.
        on_edge = np.abs(barycentric[:, [2, 0, 1]]) < 1e-9
        overhangs = (sideways > max(margin, 1e-6 * self.mesh.scale)) & (on_edge & self._is_rim[triangle]).any(axis=1)
        if not smooth:
            return nearest, facet, ~overhangs
        normals = (barycentric[..., None] * self._smooth[self._faces[triangle]]).sum(axis=1)
        return nearest, normals / np.linalg.norm(normals, axis=1, keepdims=True), ~overhangs


def _rims(mesh: trimesh.Trimesh) -> np.ndarray:
    """Which edges (face, edge) belong to one triangle only."""
    edges = np.sort(mesh.edges, axis=1).reshape(-1, 2)
    _, first, counts = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    return np.asarray((counts[first.ravel()] == 1).reshape(-1, 3))
