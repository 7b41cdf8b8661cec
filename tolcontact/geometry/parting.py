"""The separating axis of two convex bodies: the axis of the largest gap, or of the smallest penetration.

Convex bodies that do not penetrate each other are on different sides of a plane. The candidate axes are the normals of all
planes of both bodies and the common normals of their edges. The largest gap along these axes is negative if and only if the
bodies penetrate each other (Gottschalk, Lin and Manocha, OBBTree, 1996). If it is zero, they touch.
"""

from dataclasses import dataclass

import numpy as np
import scipy
import trimesh

from tolcontact.arrays import Array, Float, Int
from tolcontact.geometry import parting_kernel
from tolcontact.geometry.inset import smaller
from tolcontact.geometry.places import Places
from tolcontact.geometry.triangle_mesh import SHARP_ANGLE, coordinate_error, into_facets

CONVEX_SHARE = 1e-6  # of the hull's size: largest depth of a convex body's surface inside its hull, since files are rounded
MAX_COMPARISONS = 10_000_000  # of edges with edges


@dataclass(frozen=True, eq=False)
class Parting:
    """A moving and a reference body, both convex, in their nominal poses."""

    moving: parting_kernel.Convex
    reference: parting_kernel.Convex

    def at(self, X_RM: Float[Array, "n 12"]) -> Places:
        """Return the nearest points (n, 1) of the bodies along their separating axis at poses X_RM (n, 12).

        The normal is the axis, and the gap is negative if the bodies penetrate each other. The label is the index of the pair
        of edges that cross along the axis, -1 if it is the normal of a plane.
        """
        places = Places.none(len(X_RM), 1)
        of_poses = (np.squeeze(values, axis=1) for values in places[:-1])
        parting_kernel.part(self.moving, self.reference, np.ascontiguousarray(X_RM), *of_poses)
        return places

    def crossings(self, X_RM: Float[Array, "n 12"], edges: Int[Array, "n k"], axes: Float[Array, "n 3"]) -> Places:
        """Return the points of pairs of `edges` (n, k), -1 for none, along their common normals, at poses X_RM (n, 12).

        Normals have the sense of `axes` (n, 3); gaps are infinite where edges do not cross.
        """
        crossings = Places.none(*edges.shape)._replace(labels=np.ascontiguousarray(edges))
        poses, senses = np.ascontiguousarray(X_RM), np.ascontiguousarray(axes)
        parting_kernel.cross_edges(self.moving, self.reference, poses, crossings.labels, senses, *crossings[1:-1])
        return crossings


def parting(moving: trimesh.Trimesh, reference: trimesh.Trimesh) -> Parting | None:
    """Return the parting of two bodies in their nominal poses; None if one is not convex, or if they have too many edges."""
    A, B = convex(moving), convex(reference)
    if A is None or B is None or len(A.edges) * len(B.edges) > MAX_COMPARISONS:
        return None
    return Parting(A, B)


def convex(body: trimesh.Trimesh) -> parting_kernel.Convex | None:
    """Return the convex hull of a body with its planes and edges; None if the body does not fill its hull.

    If its file rounds coordinates, the body is smaller by their error.
    """
    if not body.is_watertight or body.volume <= 0:
        return None
    body = smaller(body, coordinate_error(body))
    hull = _hull(np.asarray(body.vertices)[np.unique(body.faces)])
    vertices, facet_normals = np.asarray(hull.vertices), np.asarray(hull.face_normals)
    neighbours, is_sharp = np.asarray(hull.face_adjacency), np.asarray(hull.face_adjacency_angles) > SHARP_ANGLE
    planes = trimesh.graph.connected_component_labels(neighbours[~is_sharp], node_count=len(facet_normals))
    # The largest triangle of a plane has the most precise normal.
    order = np.argsort(-np.asarray(hull.area_faces), kind="stable")
    normals = facet_normals[order[np.unique(np.asarray(planes)[order], return_index=True)[1]]]
    heights = (vertices @ normals.T).max(axis=0)
    triangles = np.asarray(body.triangles)
    samples = np.concatenate([triangles, (triangles + np.roll(triangles, 1, axis=1)) / 2]).reshape(-1, 3)
    depths = (heights - samples @ normals.T).min(axis=1)
    if depths.max() > CONVEX_SHARE * float(hull.scale):
        return None
    sharp_neighbours = neighbours[is_sharp]
    ends = vertices[np.asarray(hull.face_adjacency_edges)[is_sharp]]
    into = into_facets(ends, facet_normals[sharp_neighbours], np.asarray(hull.triangles_center)[sharp_neighbours])
    return parting_kernel.Convex(*(np.ascontiguousarray(values) for values in (vertices, normals, heights, ends, into)))


def _hull(points: Float[Array, "point 3"]) -> trimesh.Trimesh:
    """Return the convex hull of points, with triangles that face outwards."""
    hull = scipy.spatial.ConvexHull(points, qhull_options="QbB Pp Qt")
    faces, (a, b, c) = hull.simplices, points[hull.simplices].swapaxes(0, 1)
    is_inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    mesh = trimesh.Trimesh(points, np.where(is_inward[:, None], faces[:, ::-1], faces), process=False)
    mesh.remove_unreferenced_vertices()
    return mesh
