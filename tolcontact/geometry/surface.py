"""Faces as surfaces: nearest points on them, with normals (paper, 2.2)."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import igl
import numpy as np
import trimesh
from scipy.sparse import csr_array

from tolcontact.geometry.analytic_surfaces import AnalyticSurface
from tolcontact.geometry.edges import CREASE, on_rim, rim

OVER = 1e-6  # of a face's size: what stands no farther beside its rim is over it
TURN = 0.3  # rad: what the normals of a triangle and of the surface that it stands for differ by at most, and
BULGE = 0.05  # of a face's size: how far it may be off that
FLAT = 1e-6  # rad: faces whose normals turn by less, from end to end, are planes


class Surface:
    """A triangle surface, ready to be asked for its nearest points as often as need be.

    corner_normals   (face, 3, 3): outward unit normals at the corners of each triangle, between which they are interpolated.
                     Without them they follow from the facets around.
    surfaces         analytic surfaces; where a triangle stands for one of them, feet and normals are those of the surface
    surface_numbers  (face,): the number of the surface for which each triangle stands, -1 for none
    """

    def __init__(
        self,
        mesh: trimesh.Trimesh,
        corner_normals: np.ndarray | None = None,
        surfaces: Sequence[AnalyticSurface] = (),
        surface_numbers: np.ndarray | None = None,
    ) -> None:
        self.mesh = mesh
        self.surfaces = tuple(surfaces)
        self.surface_numbers = np.full(len(mesh.faces), -1) if surface_numbers is None else surface_numbers
        self._given = corner_normals
        self._vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
        self._faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)

    def __getstate__(self) -> dict[str, Any]:
        """What is sent to other processes: a search tree is grown again there."""
        return {name: value for name, value in self.__dict__.items() if name != "_tree"}

    @cached_property
    def corner_normals(self) -> np.ndarray:
        """Outward unit normals at the corners of each triangle (face, 3, 3)."""
        normals = np.array(_corner_normals(self.mesh) if self._given is None else self._given)
        for surface, own, outside in self._known:
            corners = np.asarray(self.mesh.triangles)[own].reshape(-1, 3)
            normals[own] = _normals_of(surface, outside, corners, normals[own].reshape(-1, 3)).reshape(-1, 3, 3)
        return normals

    @cached_property
    def _known(self) -> list[tuple[AnalyticSurface, np.ndarray, float]]:
        """The surfaces, the triangles that stand for each, and 1, or -1 if the triangles are hollow."""
        centres, facets = np.asarray(self.mesh.triangles_center), np.asarray(self.mesh.face_normals)
        found = []
        for number, surface in enumerate(self.surfaces):
            own = np.flatnonzero(self.surface_numbers == number)
            if own.size:
                _, slope = surface.distance(centres[own])
                found.append((surface, own, 1.0 if (slope * facets[own]).sum() > 0 else -1.0))
        return found

    @property
    def pieces(self) -> "list[Piece]":
        """What lies on each of its surfaces."""
        return [Piece(surface, outside < 0, self.part(own)) for surface, own, outside in self._known]

    @property
    def unknown(self) -> "Surface":
        """The triangles that stand for no surface."""
        return self.part(np.flatnonzero(self.surface_numbers < 0))

    def part(self, faces: np.ndarray) -> "Surface":
        """Some of its triangles."""
        used, renumbered = np.unique(self._faces[faces], return_inverse=True)
        mesh = trimesh.Trimesh(self._vertices[used], renumbered.reshape(-1, 3), process=False)
        return Surface(mesh, self.corner_normals[faces], self.surfaces, self.surface_numbers[faces])

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
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        for surface, some, outside in self._stand_for(triangle):
            normals[some] = _normals_of(surface, outside, points[some], normals[some])
        return np.asarray(normals)

    def _stand_for(self, triangle: np.ndarray) -> list[tuple[AnalyticSurface, np.ndarray, float]]:
        """Analytic surfaces, which of some triangles (point,) stand for each, and 1 or -1, as in `_known`."""
        if not self.surfaces:
            return []
        numbers = self.surface_numbers[triangle]
        return [
            (surface, np.flatnonzero(numbers == self.surface_numbers[own[0]]), outside) for surface, own, outside in self._known
        ]

    def placed(self, R: np.ndarray, t: np.ndarray) -> "Surface":
        """The surface turned by R (3, 3), then moved by t (3,) [mm]."""
        moved = trimesh.Trimesh(np.asarray(self.mesh.vertices) @ R.T + t, self.mesh.faces, process=False)
        return Surface(
            moved, self.corner_normals @ R.T, [surface.placed(R, t) for surface in self.surfaces], self.surface_numbers
        )

    def _barycentric(self, triangle: np.ndarray, points: np.ndarray) -> np.ndarray:
        return np.asarray(trimesh.triangles.points_to_barycentric(self.mesh.triangles[triangle], points))

    def project(self, points: np.ndarray, *, margin: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Project `points` (point, 3) [mm] onto the surface.

        Returns the nearest points (point, 3) [mm], the outward unit normals there (point, 3), and a mask (point,) of the
        points that lie over the surface, that is do not overhang its rim by more than `margin` [mm]. Where a triangle stands
        for an analytic surface, nearest points and normals are those of that surface. On other curved faces normals are
        interpolated between the corners of a facet: they change steadily as a point moves.
        """
        triangle, nearest = self.nearest(points)
        sideways, at_rim = self._sideways(points, triangle, nearest)
        over = ~at_rim | (sideways <= max(margin, OVER * self.mesh.scale))
        feet = np.array(nearest)
        for surface, some, _ in self._stand_for(triangle):
            below, own = surface.project(nearest[some]), surface.project(points[some])
            apart = np.linalg.norm(own - nearest[some], axis=1)
            height = np.linalg.norm(points[some] - nearest[some], axis=1)
            # Near its axis, and beyond, a surface has feet elsewhere.
            is_here = ~at_rim[some] & (apart <= TURN * height + BULGE * self.mesh.scale)
            feet[some] = np.where(is_here[:, None], own, below)
        return feet, self.normals(triangle, feet), over

    def depth(self, points: np.ndarray) -> np.ndarray:
        """How far `points` (point, 3) [mm] lie behind the surface (point,) [mm]; 0 in front of it, and beside it."""
        triangle, nearest = self.nearest(points)
        offset = nearest - points
        height = -(offset * np.asarray(self.mesh.face_normals)[triangle]).sum(axis=1)
        depth = np.linalg.norm(offset, axis=1)
        for surface, some, outside in self._stand_for(triangle):
            height[some] = outside * surface.distance(points[some])[0]
            depth[some] = np.abs(height[some])
        behind = np.flatnonzero(height < 0)
        sideways, at_rim = self._sideways(points[behind], triangle[behind], nearest[behind])
        over = ~at_rim | (sideways <= OVER * self.mesh.scale)
        found = np.zeros(len(points))
        found[behind[over]] = depth[behind[over]]
        return found

    def overhang(self, points: np.ndarray) -> np.ndarray:
        """How far `points` (point, 3) [mm] stand beside the surface (point,) [mm]: 0 over it."""
        sideways, at_rim = self._sideways(points, *self.nearest(points))
        return np.where(at_rim, sideways, 0.0)

    def _sideways(self, points: np.ndarray, triangle: np.ndarray, nearest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far points stand beside their nearest ones, across normals there (point,) [mm]; whether those are on the rim."""
        normal = np.array(np.asarray(self.mesh.face_normals)[triangle])
        for surface, some, _ in self._stand_for(triangle):
            normal[some] = surface.distance(nearest[some])[1]
        offset = points - nearest
        sideways = np.linalg.norm(offset - (offset * normal).sum(axis=1, keepdims=True) * normal, axis=1)
        coordinates = self._barycentric(triangle, nearest)
        # Edge j of a triangle runs from corner j to corner j+1, so it faces corner j+2: there that coordinate is zero. A
        # triangle may also touch the rim with a corner only.
        at_rim = (np.abs(coordinates[:, [2, 0, 1]]) < 1e-9) & self._rim_edges[triangle]
        at_rim |= (coordinates > 1 - 1e-9) & self._rim_corners[triangle]
        return sideways, at_rim.any(axis=1)


class Piece(NamedTuple):
    """What of a face lies on one surface; hollow if the material is around it."""

    surface: AnalyticSurface
    is_hollow: bool
    face: Surface


def _normals_of(surface: AnalyticSurface, outside: float, points: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Outward normals (point, 3) of a surface; those given (point, 3) where it has none: in the apex of a cone, on an axis."""
    _, slope = surface.distance(points)
    has_one = np.linalg.norm(slope, axis=1) > 0.5
    return np.where(has_one[:, None], outside * slope, otherwise)


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
