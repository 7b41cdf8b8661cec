"""The overlap of two bodies: the largest ball inside both, by bisection of their common box.

The depth of a point in a body changes by no more than the displacement of the point. A cell with a centre at depth f and
corners at distance r therefore contains no point deeper than f + r, and is dropped if that is too small.
"""

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
import trimesh

from tolcontact.arrays import Array, Float
from tolcontact.geometry.triangle_mesh import edges, triangle_tree

STARTING_CELLS = 6  # along the longest side of the box
MAX_LEVELS = 6
MAX_CELLS = 200  # per level: the cells with the largest possible depth
ACCURACY = 0.1  # of the depth
ON_EDGE = 1e-9  # a barycentric coordinate
SMOOTH = 0.6  # rad: triangles at a smaller angle approximate one curved face
HALVES = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T


@dataclass(frozen=True, eq=False)
class SolidBody:
    """A closed body in its nominal pose."""

    mesh: trimesh.Trimesh

    @cached_property
    def vertices(self) -> np.ndarray:
        """The vertices (vertex, 3) [mm], contiguous."""
        return np.ascontiguousarray(self.mesh.vertices, dtype=np.float64)

    @cached_property
    def faces(self) -> np.ndarray:
        """The triangles (face, 3), contiguous."""
        return np.ascontiguousarray(self.mesh.faces, dtype=np.int64)

    @cached_property
    def _tree(self) -> igl.AABB:
        return triangle_tree(self.vertices, self.faces)

    @cached_property
    def is_closed(self) -> bool:
        """Whether the body has an inside."""
        return bool(self.mesh.is_watertight)

    @cached_property
    def bounds(self) -> Float[Array, "2 3"]:
        """The lower and the upper corner (2, 3) [mm] of the box around the body."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def facet_height(self) -> float:
        """The largest height [mm] of the round faces over the triangles that approximate them, from the triangles' angles."""
        angles = np.asarray(self.mesh.face_adjacency_angles)
        smooth = np.flatnonzero((angles < SMOOTH) & (angles > 0))
        if not smooth.size:
            return 0.0
        ends = self.vertices[np.asarray(self.mesh.face_adjacency_edges)[smooth]]
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        areas = np.asarray(self.mesh.area_faces)[np.asarray(self.mesh.face_adjacency)[smooth]].max(axis=1)
        return float((2 * areas / np.maximum(lengths, 1e-300) * angles[smooth] / 8).max())

    @cached_property
    def _pseudonormals(self) -> np.ndarray:
        """The sums of the normals on both sides of each edge (face, corner, 3); the edge is opposite to the corner."""
        _, edge, _ = edges(self.faces)
        normals = np.asarray(self.mesh.face_normals).repeat(3, axis=0)
        sums = np.stack([np.bincount(edge, component) for component in normals.T], axis=1)[edge]
        return np.roll(sums.reshape(-1, 3, 3), -1, axis=1)  # edge j runs from corner j to corner j + 1

    def depth(self, points: Float[Array, "p 3"]) -> Float[Array, " p"]:
        """Return the distances (point,) [mm] of `points` (point, 3) [mm] from the surface, negative outside the body.

        The sign comes from the pseudonormal (Baerentzen and Aanaes, 2005) of the nearest face, edge or vertex.
        """
        points = np.ascontiguousarray(points)
        squares, triangle, nearest = self._tree.squared_distance(self.vertices, self.faces, points)
        coordinates = trimesh.triangles.points_to_barycentric(self.mesh.triangles[triangle], nearest)
        normals = np.array(np.asarray(self.mesh.face_normals)[triangle])
        is_zero = coordinates < ON_EDGE
        on_edge = np.flatnonzero(is_zero.sum(axis=1) == 1)
        normals[on_edge] = self._pseudonormals[triangle[on_edge], is_zero[on_edge].argmax(axis=1)]
        on_vertex = np.flatnonzero(is_zero.sum(axis=1) == 2)
        vertices = self.faces[triangle[on_vertex], coordinates[on_vertex].argmax(axis=1)]
        normals[on_vertex] = np.asarray(self.mesh.vertex_normals)[vertices]
        return np.where(((points - nearest) * normals).sum(axis=1) < 0, np.sqrt(squares), -np.sqrt(squares))


def common_ball(A: SolidBody, B: SolidBody, min_diameter: float) -> tuple[float, Float[Array, " 3"]] | None:
    """Return the diameter [mm] and the centre (3,) [mm] of approximately the largest ball in both bodies.

    None if the search finds no ball larger than `min_diameter` [mm].
    """
    lower, upper = np.maximum(A.bounds[0], B.bounds[0]), np.minimum(A.bounds[1], B.bounds[1])
    if not (upper - lower > min_diameter).all():
        return None
    counts = np.maximum(np.ceil((upper - lower) / (upper - lower).max() * STARTING_CELLS), 1).astype(int)
    size = (upper - lower) / counts
    centres = lower + size * (np.array(np.meshgrid(*map(np.arange, counts))).reshape(3, -1).T + 0.5)
    deepest, centre = min_diameter / 2, None
    for _ in range(MAX_LEVELS):
        depths = A.depth(centres)
        reach = float(np.linalg.norm(size)) / 2
        inside = np.flatnonzero(depths + reach > deepest)
        depths = np.minimum(depths[inside], B.depth(centres[inside])) if inside.size else np.zeros(0)
        if not inside.size:
            break
        if depths.max() > deepest:
            deepest, centre = float(depths.max()), centres[inside[depths.argmax()]]
        promising = np.flatnonzero(depths + reach > deepest * (1 + ACCURACY))
        promising = promising[np.argsort(-depths[promising], kind="stable")[: MAX_CELLS // len(HALVES)]]
        if not promising.size:
            break
        centres = (centres[inside[promising], None] + HALVES * size / 2).reshape(-1, 3)
        size = size / 2
    return None if centre is None else (2 * deepest, centre)
