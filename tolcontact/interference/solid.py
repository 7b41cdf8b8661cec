"""A body for the interference test: its triangles slightly inside its surface, and the edges between its planes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh

from tolcontact.arrays import Array, Float, Int
from tolcontact.geometry.inset import SAME_PLANE, capped, displacements, smaller
from tolcontact.geometry.polyhedron import merged_surface
from tolcontact.geometry.triangle_mesh import coordinate_error, edges
from tolcontact.interference.opposing_planes import MIN_SINGULAR, divided

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
    normals     (t, 3) outward, of unit length; triangles without an area have the normal of their plane
    """

    vertices: Float[Array, "v 3"]
    faces: Int[Array, "t 3"]
    edges: Int[Array, "e 2"]
    sides: Int[Array, "e 2"]
    flat: Int[Array, "n 2"]
    sources: Int[Array, " t"]
    normals: Float[Array, "t 3"]

    @cached_property
    def components(self) -> list[Int[Array, " _"]]:
        """The vertices of each connected component."""
        sides = self.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
        labels = np.asarray(trimesh.graph.connected_component_labels(sides, node_count=len(self.vertices)))
        used = np.unique(self.faces)
        order = used[np.argsort(labels[used], kind="stable")]
        return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)

    def shifts(self, triangles: Int[Array, " m"], motions: Float[Array, "m 3 3 k"]) -> Float[Array, "v 3 k"]:
        """Return how vertices move as `motions` of the corners of `triangles`, all that meet in them, displace their planes.

        A vertex stays on all planes around it (see `displacements`). Each of the k columns is a separate case.
        """
        N, vectors = self.normals[triangles].repeat(3, axis=0), motions.reshape(3 * len(triangles), 3, motions.shape[3])
        heights = np.einsum("pj,pjk->pk", N, vectors)
        return displacements(self.faces[triangles].ravel(), N, heights, len(self.vertices), MIN_SINGULAR, vectors)

    def inset(self, depths: Float[Array, " t"]) -> Float[Array, "v 3"]:
        """Return the shifts (v, 3) [mm] of the vertices that put the planes of triangles `depths` (t,) [mm] deeper."""
        motions = (-depths[:, None] * self.normals)[:, None].repeat(3, axis=1)
        shifts = self.shifts(np.arange(len(self.faces)), motions[..., None])[..., 0]
        return capped(shifts, MAX_SHIFT * float(depths.max(initial=0.0)))


def solid(body: trimesh.Trimesh) -> Solid | None:
    """Return a body in its nominal place; None if it is not closed, and so has no inside.

    If its file rounds coordinates, it is smaller by their error.
    """
    merged, sources, is_closed = merged_surface(body)
    if not is_closed or body.volume <= 0:
        return None
    whole = divided(smaller(merged, coordinate_error(body)), SAME_PLANE)
    faces, plane = np.asarray(whole.mesh.faces), np.arange(len(whole.mesh.faces))
    plane[whole.added] = whole.extended
    a, b, c = np.asarray(whole.mesh.vertices)[faces[plane]].swapaxes(0, 1)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    ends, edge, triangles_there = edges(faces)
    lone = np.flatnonzero(triangles_there[edge] == 1)
    neighbours = np.asarray(whole.mesh.face_adjacency)
    angles = trimesh.geometry.vector_angle(normals[neighbours])
    sharp = angles > SAME_PLANE
    return Solid(
        np.ascontiguousarray(whole.mesh.vertices, dtype=np.float64),
        np.ascontiguousarray(faces, dtype=np.int64),
        np.concatenate([whole.mesh.face_adjacency_edges[sharp], ends[lone]]).astype(np.int64),
        np.concatenate([neighbours[sharp], lone[:, None].repeat(2, axis=1) // 3]).astype(np.int64),
        neighbours[~sharp],
        np.concatenate([sources, sources[whole.extended]]),
        normals,
    )
