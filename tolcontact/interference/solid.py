"""A body for the interference test: its triangles slightly inside its surface, and the edges between its planes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh

from tolcontact.arrays import Array, Float, Int
from tolcontact.geometry.inset import smaller
from tolcontact.geometry.merged_surface import merged_surface
from tolcontact.geometry.triangle_mesh import coordinate_error, edges
from tolcontact.geometry.vertex_displacements import capped, displacements

SAME_PLANE = 1e-5  # rad: facets whose normals differ by less are one plane
MIN_SINGULAR = 0.05  # of the planes around a vertex: directions with a smaller singular value are left alone
MAX_SHIFT = 8.0  # insets: the largest motion of a vertex, for needles


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed body in its nominal place.

    vertices    (v, 3) [mm]
    faces       (t, 3): triangles
    edges       (e, 2): edges between different planes
    sides       (e, 2): the triangles at each edge, the same one twice where the other has no area
    flat        (n, 2): triangles that share an edge and lie in one plane
    sources     (t,): the triangle of the part's mesh that each triangle is
    """

    vertices: Float[Array, "v 3"]
    faces: Int[Array, "t 3"]
    edges: Int[Array, "e 2"]
    sides: Int[Array, "e 2"]
    flat: Int[Array, "n 2"]
    sources: Int[Array, " t"]

    @cached_property
    def normals(self) -> Float[Array, "t 3"]:
        """The outward unit normals of the triangles."""
        a, b, c = self.vertices[self.faces].swapaxes(0, 1)
        normals = np.cross(b - a, c - a)
        return normals / np.linalg.norm(normals, axis=1)[:, None]

    @cached_property
    def components(self) -> list[Int[Array, " _"]]:
        """The vertices of each connected component."""
        sides = self.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
        labels = np.asarray(trimesh.graph.connected_component_labels(sides, node_count=len(self.vertices)))
        used = np.unique(self.faces)
        order = used[np.argsort(labels[used], kind="stable")]
        return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)

    def shifts(self, outward: Float[Array, "t 3 k"]) -> Float[Array, "v 3 k"]:
        """Return how vertices move if the plane of each triangle moves out of the body by `outward` at its corners.

        A vertex stays on all planes around it (see `displacements`). Each of the k columns is a separate case.
        """
        N, heights = self.normals.repeat(3, axis=0), outward.reshape(-1, outward.shape[2])
        return displacements(self.faces.ravel(), N, heights, len(self.vertices), MIN_SINGULAR)

    def inset(self, depths: Float[Array, " t"]) -> Float[Array, "v 3"]:
        """Return the shifts (v, 3) [mm] of the vertices that put the planes of triangles `depths` (t,) [mm] deeper."""
        shifts = self.shifts(np.broadcast_to(-depths[:, None, None], (len(self.faces), 3, 1)))[..., 0]
        return capped(shifts, MAX_SHIFT * float(depths.max(initial=0.0)))


def solid(body: trimesh.Trimesh) -> Solid | None:
    """Return a body in its nominal place; None if it is not closed, and so has no inside.

    If its file rounds coordinates, it is smaller by their error.
    """
    merged, sources, is_closed = merged_surface(body)
    if not is_closed or body.volume <= 0:
        return None
    merged = smaller(merged, coordinate_error(body))
    ends, edge, triangles_there = edges(merged.faces)
    lone = np.flatnonzero(triangles_there[edge] == 1)
    sharp = np.asarray(merged.face_adjacency_angles) > SAME_PLANE
    return Solid(
        np.ascontiguousarray(merged.vertices, dtype=np.float64),
        np.ascontiguousarray(merged.faces, dtype=np.int64),
        np.concatenate([merged.face_adjacency_edges[sharp], ends[lone]]).astype(np.int64),
        np.concatenate([merged.face_adjacency[sharp], lone[:, None].repeat(2, axis=1) // 3]).astype(np.int64),
        np.asarray(merged.face_adjacency)[~sharp],
        sources,
    )
