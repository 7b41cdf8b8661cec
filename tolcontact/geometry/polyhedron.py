"""A face of a body with its ends: the corners, edges and facets at which it can touch another one."""

from typing import NamedTuple

import numpy as np
import trimesh

from tolcontact.arrays import Array, Float, Int
from tolcontact.geometry.inset import smaller
from tolcontact.geometry.merged_surface import merged_surface
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.triangle_mesh import SHARP_ANGLE, coordinate_error, edges, into_facets


class Polyhedron(NamedTuple):
    """The triangles of a face, and the edges and corners around them, in the nominal assembly frame [mm].

    Vertices inside a plane, and edges between facets of one plane, cannot be the first to touch anything, and are left out.

    vertices     (v, 3): the corners of the face
    cones        (v + 1,): the first direction of each corner, and the end
    directions   (d, 3): unit vectors along the edges of the body that start at each corner
    facets       (t, 3, 3): the triangles
    normals      (t, 3): their outward unit normals
    inward       (t, 3, 3): unit vectors across each edge of a triangle, into it; edge j starts at corner j
    edges        (e, 2, 3): the edges of the face, between planes or at its rim
    ends         (e, 2): the corners at which each edge starts and ends
    into         (e, 2, 3): unit vectors across each edge into the two facets of the body that meet there
    edge_normals (e, 2, 3): outward unit normals of these two facets
    convex       (e,): whether the body is convex there
    facet_planes, vertex_planes, edge_planes   index of the plane of each facet (t,); indices of the planes around each vertex
                 (v, plane) and on both sides of each edge (e, 2), -1 for none
    triangles    (f, 3, 3): all triangles of the body, none if it is not closed
    """

    vertices: Float[Array, "v 3"]
    cones: Int[Array, " _"]
    directions: Float[Array, "d 3"]
    facets: Float[Array, "t 3 3"]
    normals: Float[Array, "t 3"]
    inward: Float[Array, "t 3 3"]
    edges: Float[Array, "e 2 3"]
    ends: Int[Array, "e 2"]
    into: Float[Array, "e 2 3"]
    edge_normals: Float[Array, "e 2 3"]
    convex: Int[Array, " e"]
    facet_planes: Int[Array, " t"]
    vertex_planes: Int[Array, "v p"]
    edge_planes: Int[Array, "e 2"]
    triangles: Float[Array, "f 3 3"]


def polyhedron(face: Surface, body: trimesh.Trimesh) -> Polyhedron:
    """Return the polyhedron of a face of a body, both in their nominal poses.

    Planes of the body count as a whole, even where the face was cut out of them: the body does not end there. If its file
    rounds coordinates, it is smaller by their error.
    """
    merged, _, is_closed = merged_surface(body)
    numbers, _ = Surface(merged).nearest(np.asarray(face.mesh.triangles_center))
    merged = smaller(merged, coordinate_error(body))
    vertices, faces = np.asarray(merged.vertices), np.asarray(merged.faces)
    facet_normals = np.asarray(merged.face_normals)
    outer_ends, edge, triangles_there = edges(faces)
    is_open = triangles_there[edge] == 1
    lone = np.flatnonzero(is_open)[:, None] // 3
    neighbours = np.concatenate([merged.face_adjacency, lone.repeat(2, axis=1)])
    ends = np.concatenate([merged.face_adjacency_edges, outer_ends[is_open]])
    is_sharp = np.concatenate([np.asarray(merged.face_adjacency_angles) > SHARP_ANGLE, np.ones(len(lone), dtype=bool)])
    is_convex = np.concatenate([merged.face_adjacency_convex, np.ones(len(lone), dtype=bool)])
    planes = trimesh.graph.connected_component_labels(neighbours[~is_sharp], node_count=len(faces))
    is_chosen = np.isin(planes, planes[numbers])
    indices = np.flatnonzero(is_chosen)
    is_ours = is_sharp & is_chosen[neighbours].any(axis=1)
    into = into_facets(vertices[ends], facet_normals[neighbours], np.asarray(merged.triangles_center)[neighbours])
    corners = np.unique(ends[is_ours])
    corners = corners[np.isin(corners, faces[indices])]
    cones, directions = _cones(corners, ends[is_sharp], vertices)
    edge_planes = np.where(is_chosen[neighbours], planes[neighbours], -1)
    triangles = vertices[faces[indices]]
    sides = np.roll(triangles, -1, axis=1) - triangles
    sides /= np.linalg.norm(sides, axis=2)[..., None]
    return Polyhedron(
        vertices=vertices[corners],
        cones=cones,
        directions=directions,
        facets=triangles,
        normals=facet_normals[indices],
        inward=np.cross(facet_normals[indices][:, None], sides),
        edges=vertices[ends][is_ours],
        ends=np.searchsorted(corners, ends[is_ours]),
        into=into[is_ours],
        edge_normals=facet_normals[neighbours][is_ours],
        convex=is_convex[is_ours].astype(np.int64),
        facet_planes=planes[indices],
        vertex_planes=_planes_around(corners, faces[indices], planes[indices]),
        edge_planes=edge_planes[is_ours],
        triangles=vertices[faces] if is_closed else np.zeros((0, 3, 3)),
    )


def _cones(corners: np.ndarray, edges: np.ndarray, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return cones (corner + 1,) and directions (d, 3) of `corners` (corner,), from the vertex indices of edges."""
    starts, ends = np.concatenate([edges, edges[:, ::-1]]).T
    is_corner = np.isin(starts, corners)
    starts, ends = starts[is_corner], ends[is_corner]
    order = np.argsort(starts, kind="stable")
    directions = vertices[ends[order]] - vertices[starts[order]]
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return np.searchsorted(starts[order], np.append(corners, len(vertices))), directions


def _planes_around(corners: np.ndarray, faces: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return the planes (corner, plane) of the `faces` (face, 3) around each corner, padded with -1."""
    pairs = np.unique(np.stack([faces.ravel(), planes.repeat(3)], axis=1), axis=0)
    corner_index = np.searchsorted(corners, pairs[:, 0])
    is_corner = np.isin(pairs[:, 0], corners)
    corner_index, plane = corner_index[is_corner], pairs[is_corner, 1]
    rank = np.arange(len(corner_index)) - np.searchsorted(corner_index, corner_index)
    table = np.full((len(corners), rank.max(initial=0) + 1), -1)
    table[corner_index, rank] = plane
    return table
