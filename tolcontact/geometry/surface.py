"""Faces as surfaces: nearest points and normals (paper, 2.2)."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import igl
import numpy as np
import trimesh
from scipy.sparse import csr_array
from trimesh.triangles import points_to_barycentric

from tolcontact.geometry.analytic_surfaces import AnalyticSurface, axes_across
from tolcontact.geometry.region_kernel import Region
from tolcontact.geometry.tolerances import SAME_DIRECTION, SAME_PLACE
from tolcontact.geometry.triangle_mesh import CREASE, on_rim, oriented, placed_mesh, rim, triangle_tree

EVERY = slice(None)
MAX_TURN = 0.3  # rad: between the normals of a triangle and of the analytic surface that it approximates
MAX_BULGE = 0.05  # of a face's size: between a triangle and the analytic surface that it approximates


class Surface:
    """The triangles of a face, with a search tree for nearest points.

    vertices, faces  (vertex, 3) [mm] and (face, 3), both contiguous
    corner_normals   (face, 3, 3): outward unit normals at the corners of each triangle, interpolated inside the triangle; by
                     default they follow from the neighbouring facets
    surfaces         analytic surfaces; where a triangle approximates one, projections and normals refer to that surface
    surface_numbers  (face,): the index of the surface that each triangle approximates, -1 for none
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
        self._stated_normals = corner_normals
        self.vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(mesh.faces, dtype=np.int64)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for other processes, which build their own search tree."""
        return {name: value for name, value in self.__dict__.items() if name != "_tree"}

    @cached_property
    def corner_normals(self) -> np.ndarray:
        """Outward unit normals at the corners of each triangle (face, 3, 3)."""
        normals = np.array(_corner_normals(self.mesh) if self._stated_normals is None else self._stated_normals)
        for surface, rows, side in self._rows_on_surfaces():
            corners = np.asarray(self.mesh.triangles)[rows].reshape(-1, 3)
            normals[rows] = _normals_of(surface, side, corners, normals[rows].reshape(-1, 3)).reshape(-1, 3, 3)
        return normals

    @cached_property
    def _sides(self) -> np.ndarray:
        """A sign (surface,) for each analytic surface: 1, or -1 if its triangles are hollow."""
        centres, facets = np.asarray(self.mesh.triangles_center), np.asarray(self.mesh.face_normals)
        rows = [np.flatnonzero(self.surface_numbers == number) for number in range(len(self.surfaces))]
        slopes = [surface.distance(centres[of_surface])[1] for surface, of_surface in zip(self.surfaces, rows, strict=True)]
        outward = [(slope * facets[of_surface]).sum() > 0 for slope, of_surface in zip(slopes, rows, strict=True)]
        return np.where(outward, 1.0, -1.0)

    def _rows_on_surfaces(self, triangle: np.ndarray | slice = EVERY) -> Iterator[tuple[AnalyticSurface, np.ndarray, float]]:
        """Yield each analytic surface, the rows of `triangle` (point,) that approximate it, and its side."""
        numbers = self.surface_numbers[triangle] if self.surfaces else np.zeros(0, dtype=int)
        for number, surface in enumerate(self.surfaces):
            rows = np.flatnonzero(numbers == number)
            if rows.size:
                yield surface, rows, float(self._sides[number])

    @cached_property
    def pieces(self) -> "list[Piece]":
        """The parts of the face that lie on its analytic surfaces."""
        return [Piece(surface, side < 0, self.part(rows)) for surface, rows, side in self._rows_on_surfaces()]

    @property
    def only_piece(self) -> "Piece | None":
        """The face as a piece; None if it spans several surfaces, or has triangles that approximate none."""
        numbers = np.unique(self.surface_numbers)
        return self.pieces[0] if len(numbers) == 1 and numbers[0] >= 0 else None

    @cached_property
    def bulge(self) -> float:
        """The largest distance [mm] of triangles, at their centroids and edge midpoints, from their analytic surfaces."""
        corners = np.asarray(self.mesh.triangles)
        midpoints = np.concatenate([(corners + np.roll(corners, -1, axis=1)) / 2, corners.mean(axis=1, keepdims=True)], axis=1)
        return max(
            (
                float(np.abs(surface.distance(midpoints[rows].reshape(-1, 3))[0]).max())
                for surface, rows, _ in self._rows_on_surfaces()
            ),
            default=0.0,
        )

    @cached_property
    def unknown(self) -> "Surface":
        """The triangles that approximate no analytic surface."""
        return self.part(np.flatnonzero(self.surface_numbers < 0))

    def part(self, faces: np.ndarray) -> "Surface":
        """Return the surface of a subset of the triangles (face,)."""
        used, renumbered = np.unique(self.faces[faces], return_inverse=True)
        mesh = trimesh.Trimesh(self.vertices[used], renumbered.reshape(-1, 3), process=False)
        return Surface(mesh, self.corner_normals[faces], self.surfaces, self.surface_numbers[faces])

    @cached_property
    def curvature(self) -> float:
        """The area-weighted median of the curvature [1/mm], from the rotation of normals; 0 for a flat face."""
        corners, normals = np.asarray(self.mesh.triangles), self.corner_normals
        length, turn = (np.linalg.norm(np.roll(values, -1, axis=1) - values, axis=2) for values in (corners, normals))
        rate = (turn / np.maximum(length, 1e-300)).max(axis=1)
        order = np.argsort(rate)
        middle = np.searchsorted(np.cumsum(self.mesh.area_faces[order]), self.mesh.area / 2)
        median = float(rate[order[min(middle, len(order) - 1)]])
        return median if median * self.mesh.scale > SAME_DIRECTION else 0.0

    @cached_property
    def _tree(self) -> igl.AABB:
        return triangle_tree(self.vertices, self.faces)

    @cached_property
    def _rim_edges(self) -> np.ndarray:
        """Mask (face, edge) of the edges on the rim."""
        return on_rim(self.faces)

    @cached_property
    def rim(self) -> np.ndarray:
        """The vertex indices (edge, 2) of the edges on the rim."""
        return rim(self.faces)

    @property
    def rim_ends(self) -> np.ndarray:
        """The ends (edge, 2, 3) [mm] of the edges on the rim."""
        return self.vertices[self.rim]

    @property
    def rim_corners(self) -> np.ndarray:
        """The vertices (corner, 3) [mm] on the rim."""
        return self.vertices[np.unique(self.rim)]

    @cached_property
    def _rim_corners(self) -> np.ndarray:
        """Mask (face, corner) of the corners on the rim."""
        return np.isin(self.faces, self.rim)

    @cached_property
    def is_flat(self) -> bool:
        """Whether the whole surface lies in one plane."""
        normals = self.corner_normals.reshape(-1, 3)
        n = normals.mean(axis=0)
        size = np.linalg.norm(n)
        if size == 0:  # opposite normals cancel
            return False
        heights = self.vertices @ (n / size)
        return bool(np.ptp(heights) < SAME_PLACE * self.mesh.scale and (normals @ n).min() > 0)

    @cached_property
    def chords(self) -> tuple[np.ndarray, np.ndarray]:
        """The heights (face,) [mm] of the arcs over the edges of triangles, and the lengths (face,) [mm] of these edges."""
        corners, normals = np.asarray(self.mesh.triangles), self.corner_normals
        chord, turn = (np.roll(values, -1, axis=1) - values for values in (corners, normals))
        return np.abs((chord * turn).sum(axis=2)).max(axis=1) / 8, np.linalg.norm(chord, axis=2).max(axis=1)

    @property
    def chord_height(self) -> float:
        """The largest distance [mm] of the triangles from the round surface that they approximate."""
        return float(self.chords[0].max(initial=0.0))

    @cached_property
    def region(self) -> Region:
        """A flat face, seen along its normal."""
        axes = axes_across(self.corner_normals[0, 0])
        edges = self.rim_ends @ axes.T
        return Region(np.ascontiguousarray(axes), np.ascontiguousarray(edges), SAME_PLACE * float(self.mesh.scale))

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the triangle (point,), and the point on it (point, 3) [mm], nearest to each of `points` (point, 3) [mm]."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        _, triangle, nearest = self._tree.squared_distance(self.vertices, self.faces, points)
        return triangle, nearest

    def normals(self, triangle: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return outward unit normals (point, 3) at `points` (point, 3) [mm] on the triangles `triangle` (point,)."""
        barycentric = points_to_barycentric(self.mesh.triangles[triangle], points)
        normals = (barycentric[..., None] * self.corner_normals[triangle]).sum(axis=1)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        for surface, rows, side in self._rows_on_surfaces(triangle):
            normals[rows] = _normals_of(surface, side, points[rows], normals[rows])
        return normals

    def placed(self, R: np.ndarray, t: np.ndarray) -> "Surface":
        """Return the surface rotated or mirrored by R (3, 3), then translated by t (3,) [mm]."""
        mesh = placed_mesh(self.vertices, self.mesh.faces, R, t)
        surfaces = [surface.placed(R, t) for surface in self.surfaces]
        return Surface(mesh, oriented(self.corner_normals, R) @ R.T, surfaces, self.surface_numbers)

    def project(self, points: np.ndarray, *, margin: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Project `points` (point, 3) [mm] onto the surface.

        Returns the nearest points (point, 3) [mm], the outward unit normals there (point, 3), and a mask (point,) of the
        points that lie over the surface, that is, overhang its rim by at most `margin` [mm]. Where a triangle approximates an
        analytic surface, nearest points and normals refer to that surface. On other curved faces normals are interpolated
        between the corners of a facet, so that they change continuously as a point moves.
        """
        triangle, nearest = self.nearest(points)
        lateral, at_rim = self._lateral_distances(points, triangle, nearest)
        is_over = ~at_rim | (lateral <= max(margin, SAME_PLACE * self.mesh.scale))
        projections = np.array(nearest)
        for surface, rows, _ in self._rows_on_surfaces(triangle):
            nearby, direct = surface.project(nearest[rows]), surface.project(points[rows])
            shift = np.linalg.norm(direct - nearest[rows], axis=1)
            height = np.linalg.norm(points[rows] - nearest[rows], axis=1)
            # Points near the axis of a surface, or beyond it, have projections elsewhere.
            is_direct = ~at_rim[rows] & (shift <= MAX_TURN * height + MAX_BULGE * self.mesh.scale)
            projections[rows] = np.where(is_direct[:, None], direct, nearby)
        return projections, self.normals(triangle, projections), is_over

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Return the depth (point,) [mm] of `points` (point, 3) [mm] behind the surface; 0 in front of it or beyond its rim."""
        triangle, nearest = self.nearest(points)
        offset = nearest - points
        height = -(offset * np.asarray(self.mesh.face_normals)[triangle]).sum(axis=1)
        distance = np.linalg.norm(offset, axis=1)
        for surface, rows, side in self._rows_on_surfaces(triangle):
            height[rows] = side * surface.distance(points[rows])[0]
            distance[rows] = np.abs(height[rows])
        behind = np.flatnonzero(height < 0)
        lateral, at_rim = self._lateral_distances(points[behind], triangle[behind], nearest[behind])
        is_over = ~at_rim | (lateral <= SAME_PLACE * self.mesh.scale)
        depth = np.zeros(len(points))
        depth[behind[is_over]] = distance[behind[is_over]]
        return depth

    def overhang(self, points: np.ndarray) -> np.ndarray:
        """Return the overhang (point,) [mm] of `points` (point, 3) [mm] beyond the rim; 0 over the surface."""
        lateral, at_rim = self._lateral_distances(points, *self.nearest(points))
        return np.where(at_rim, lateral, 0.0)

    def _lateral_distances(
        self, points: np.ndarray, triangle: np.ndarray, nearest: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return lateral distances (point,) [mm] from the nearest points, and a mask of the nearest points on the rim."""
        normal = np.array(np.asarray(self.mesh.face_normals)[triangle])
        for surface, rows, _ in self._rows_on_surfaces(triangle):
            normal[rows] = surface.distance(nearest[rows])[1]
        offset = points - nearest
        lateral = np.linalg.norm(offset - (offset * normal).sum(axis=1, keepdims=True) * normal, axis=1)
        coordinates = points_to_barycentric(self.mesh.triangles[triangle], nearest)
        # Edge j of a triangle runs from corner j to corner j+1, so on it the coordinate of corner j+2 is zero. A triangle may
        # also touch the rim with a corner only.
        at_rim = (np.abs(coordinates[:, [2, 0, 1]]) < 1e-9) & self._rim_edges[triangle]
        at_rim |= (coordinates > 1 - 1e-9) & self._rim_corners[triangle]
        return lateral, at_rim.any(axis=1)


class Piece(NamedTuple):
    """The part of a face that lies on an analytic surface; it is hollow if the material surrounds it."""

    surface: AnalyticSurface
    is_hollow: bool
    face: Surface


def _normals_of(surface: AnalyticSurface, side: float, points: np.ndarray, fallback: np.ndarray) -> np.ndarray:
    """Return outward normals (point, 3) of an analytic surface, or `fallback` (point, 3) at its apex and on its axis."""
    _, slope = surface.distance(points)
    is_unit = np.linalg.norm(slope, axis=1) > 0.5
    return np.where(is_unit[:, None], side * slope, fallback)


def _corner_normals(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return normals at the corners of each triangle (face, 3, 3): the mean of the adjacent facets on this side of creases.

    Facets are weighted by their corner angles, so that normals do not depend on the triangulation. A flat face keeps its
    normal to the last bit.
    """
    facet, corner = np.asarray(mesh.face_normals), np.asarray(mesh.faces).ravel()
    of_vertex = csr_array((np.ones(len(corner)), (np.arange(len(corner)), corner)), shape=(len(corner), len(mesh.vertices)))
    row, column = (of_vertex @ of_vertex.T).nonzero()  # pairs of corners that share a vertex
    cosine = (facet[row // 3] * facet[column // 3]).sum(axis=1)
    row, column, is_flat = row[cosine > CREASE], column[cosine > CREASE], cosine[cosine > CREASE] > 1 - 1e-14
    weight = np.asarray(mesh.face_angles).ravel()[column]
    turn = np.where(is_flat[:, None], 0, facet[column // 3] - facet[row // 3]) * weight[:, None]
    total = np.bincount(row, weight, len(corner))
    mean = facet.repeat(3, axis=0)
    mean += np.stack([np.bincount(row, turn[:, k], len(corner)) for k in range(3)], axis=1) / total[:, None]
    return (mean / np.linalg.norm(mean, axis=1, keepdims=True)).reshape(-1, 3, 3)
