"""Faces as surfaces: nearest points on them, with normals (paper, 2.2)."""

from functools import cached_property

import igl
import numpy as np
import trimesh
from scipy.sparse import csr_array

from tolcontact.discretization.edges import on_rim, rim

FLAT = 1e-6  # rad: faces whose normals turn by less, from end to end, are planes
CREASE = np.cos(np.radians(30.0))  # facets that meet at a wider angle are two faces; else they approximate one curved face


class Surface:
    """A triangle surface, ready to be asked for its nearest points as often as need be.

    corner_normals   (face, 3, 3): outward unit normals at the corners of each triangle, between which they are interpolated.
                     Without them they follow from the facets around.
    """

    def __init__(self, mesh: trimesh.Trimesh, corner_normals: np.ndarray | None = None) -> None:
        self.mesh = mesh
        self._given = corner_normals
        self._vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
        self._faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)

    @cached_property
    def corner_normals(self) -> np.ndarray:
        """Outward unit normals at the corners of each triangle (face, 3, 3)."""
        return _corner_normals(self.mesh) if self._given is None else self._given

    @cached_property
    def curvature(self) -> float:
        """How fast its normals turn, usually [1/mm]: of half its area by more, of half by less. 0 of a flat face."""
        corners, normals = np.asarray(self.mesh.triangles), self.corner_normals
        along, turn = (np.linalg.norm(np.roll(each, -1, axis=1) - each, axis=2) for each in (corners, normals))
        fastest = (turn / np.maximum(along, 1e-300)).max(axis=1)
        order = np.argsort(fastest)
        middle = np.searchsorted(np.cumsum(self.mesh.area_faces[order]), self.mesh.area / 2)
        usual = float(fastest[order[min(middle, len(order) - 1)]])
        return usual if usual * self.mesh.scale > FLAT else 0.0

    @cached_property
    def _tree(self) -> igl.AABB:
        tree = igl.AABB()
        tree.init(self._vertices, self._faces)
        return tree

    @cached_property
    def _rim_edges(self) -> np.ndarray:
        """Which edges (face, edge) are on the rim."""
        return on_rim(self._faces)

    @cached_property
    def _rim_corners(self) -> np.ndarray:
        """Which corners (face, corner) are on the rim."""
        return np.isin(self._faces, rim(self._faces))

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The triangle (point,) and the place on it (point, 3) [mm] that is nearest to each of `points` (point, 3) [mm]."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        _, triangle, nearest = self._tree.squared_distance(self._vertices, self._faces, points)
        return triangle, nearest

    def normals(self, triangle: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Outward unit normals (point, 3) at `points` (point, 3) [mm] on the given triangles (point,)."""
        barycentric = self._barycentric(triangle, points)
        normals = (barycentric[..., None] * self.corner_normals[triangle]).sum(axis=1)
        return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))

    def placed(self, R: np.ndarray, t: np.ndarray) -> "Surface":
        """The surface turned by R (3, 3), then moved by t (3,) [mm]."""
        moved = trimesh.Trimesh(np.asarray(self.mesh.vertices) @ R.T + t, self.mesh.faces, process=False)
        return Surface(moved, self.corner_normals @ R.T)

    def _barycentric(self, triangle: np.ndarray, points: np.ndarray) -> np.ndarray:
        return np.asarray(trimesh.triangles.points_to_barycentric(self.mesh.triangles[triangle], points))

    def project(self, points: np.ndarray, *, margin: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Project `points` (point, 3) [mm] onto the surface.

        Returns the nearest points (point, 3) [mm], the outward unit normals there (point, 3), and a mask (point,) of the
        points that lie over the surface, that is do not overhang its rim by more than `margin` [mm]. On curved faces the
        normals are interpolated between the corners of a facet: they change steadily as a point moves.
        """
        triangle, nearest = self.nearest(points)
        over = self._overhang(points, triangle, nearest) <= max(margin, 1e-6 * self.mesh.scale)
        return nearest, self.normals(triangle, nearest), over

    def depth(self, points: np.ndarray) -> np.ndarray:
        """How far `points` (point, 3) [mm] lie behind the surface (point,) [mm]; 0 in front of it, and beside it."""
        triangle, nearest = self.nearest(points)
        offset = nearest - points
        behind = np.flatnonzero((offset * np.asarray(self.mesh.face_normals)[triangle]).sum(axis=1) > 0)
        over = self._overhang(points[behind], triangle[behind], nearest[behind]) <= 1e-6 * self.mesh.scale
        depth = np.zeros(len(points))
        depth[behind[over]] = np.linalg.norm(offset[behind[over]], axis=1)
        return depth

    def overhang(self, points: np.ndarray) -> np.ndarray:
        """How far `points` (point, 3) [mm] stand beside the surface (point,) [mm]: 0 over it."""
        return self._overhang(points, *self.nearest(points))

    def _overhang(self, points: np.ndarray, triangle: np.ndarray, nearest: np.ndarray) -> np.ndarray:
        facet = np.asarray(self.mesh.face_normals)[triangle]
        offset = points - nearest
        sideways = np.linalg.norm(offset - (offset * facet).sum(axis=1, keepdims=True) * facet, axis=1)
        coordinates = self._barycentric(triangle, nearest)
        # Edge j of a triangle runs from corner j to corner j+1, so it faces corner j+2: there that coordinate is zero. A
        # triangle may also touch the rim with a corner only.
        at_rim = (np.abs(coordinates[:, [2, 0, 1]]) < 1e-9) & self._rim_edges[triangle]
        at_rim |= (coordinates > 1 - 1e-9) & self._rim_corners[triangle]
        return np.where(at_rim.any(axis=1), sideways, 0.0)


def _corner_normals(mesh: trimesh.Trimesh) -> np.ndarray:
    """Normals at the corners of each triangle (face, 3, 3): those of the facets around, but for what lies across a crease.

    Weighted by the facets' angles there, so that they do not depend on the triangulation. A flat face keeps its own, exactly.
    """
    facet, corner = np.asarray(mesh.face_normals), np.asarray(mesh.faces).ravel()
    of_vertex = csr_array((np.ones(len(corner)), (np.arange(len(corner)), corner)), shape=(len(corner), len(mesh.vertices)))
    here, there = (of_vertex @ of_vertex.T).nonzero()
    cosine = (facet[here // 3] * facet[there // 3]).sum(axis=1)
    here, there, flat = here[cosine > CREASE], there[cosine > CREASE], cosine[cosine > CREASE] > 1 - 1e-14
    weight = np.asarray(mesh.face_angles).ravel()[there]
    turn = np.where(flat[:, None], 0, facet[there // 3] - facet[here // 3]) * weight[:, None]
    total = np.bincount(here, weight, len(corner))
    mean = facet.repeat(3, axis=0)
    mean += np.stack([np.bincount(here, turn[:, k], len(corner)) for k in range(3)], axis=1) / total[:, None]
    return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True)).reshape(-1, 3, 3)
