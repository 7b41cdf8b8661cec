"""A face of a body with its ends: the corners, edges and facets at which it can touch another one."""

from typing import NamedTuple

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from tolcontact.arrays import Array, Float, Int
from tolcontact.geometry.inset import smaller
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.tolerances import ROUNDING
from tolcontact.geometry.triangle_mesh import SHARP_ANGLE, coordinate_error, edges, have_area, into_facets

SAME_TURN = 1e-9  # of a full turn: largest angle between triangles at an edge that count as coincident


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


def merged_surface(body: trimesh.Trimesh) -> tuple[trimesh.Trimesh, Int[Array, " t"], bool]:
    """Return the triangles of a body that have an area, with merged vertices, and their indices in the body.

    The last result is whether each triangle of the body continues into others along all its edges.

    Two blocks that touch along an edge, or in a corner, have an edge with four triangles, or a corner with two fans. They are
    closed nevertheless: each triangle continues into the triangle on the other side of its material, and each fan has its own
    vertex.
    """
    surface = trimesh.Trimesh(body.vertices, body.faces, process=False)
    surface.merge_vertices(digits_vertex=int(np.ceil(-np.log10(ROUNDING * max(surface.scale, 1e-9)))))
    proper_faces = np.flatnonzero((np.diff(np.sort(surface.faces, axis=1), axis=1) > 0).all(axis=1))
    vertices = np.asarray(surface.vertices)
    faces, divided = _divided(vertices, np.asarray(surface.faces)[proper_faces])
    twins = _twins(vertices, faces)
    if twins is None:
        surface.update_faces(proper_faces)
        sources = proper_faces
    else:
        surface, sources = _apart(vertices, faces, twins), proper_faces[divided]
    proper = have_area(surface)
    surface.update_faces(proper)
    return surface, sources[proper], twins is not None


def _divided(vertices: np.ndarray, faces: np.ndarray) -> tuple[Int[Array, "d 3"], Int[Array, " d"]]:
    """Return faces (t, 3) divided at vertices that lie on their edges, and the face that each one is part of (d,).

    The mesh of two blocks that touch along part of an edge may have a vertex in the middle of that edge. Only edges between
    different planes are divided. Triangles without an area that join such a vertex to its edge are left out.
    """
    sources = np.arange(len(faces))
    vertex, ends = _on_edges(vertices, faces)
    for v, (a, b) in zip(vertex, ends, strict=True):
        there = np.flatnonzero((faces == a).any(axis=1) & (faces == b).any(axis=1))
        at_edge = there[(faces[there] != v).all(axis=1)]
        first, second = faces[at_edge].copy(), faces[at_edge]
        first[first == a], second[second == b] = v, v
        faces = np.concatenate([np.delete(faces, there, axis=0), first, second])
        sources = np.concatenate([np.delete(sources, there), sources[at_edge], sources[at_edge]])
    order = np.argsort(sources, kind="stable")
    return faces[order], sources[order]


def _on_edges(vertices: np.ndarray, faces: np.ndarray) -> tuple[Int[Array, " m"], Int[Array, "m 2"]]:
    """Return the vertices (m,) that lie on an edge between different planes, and the ends (m, 2) of what they divide.

    Several vertices of one edge follow each other, so that each divides what is left by the one before.
    """
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    ends = np.asarray(mesh.face_adjacency_edges)[np.asarray(mesh.face_adjacency_angles) > SAME_TURN]
    start, along = vertices[ends[:, 0]], np.subtract(*vertices[ends[:, ::-1]].swapaxes(0, 1))
    lengths, limit = np.linalg.norm(along, axis=1), ROUNDING * mesh.scale
    tree, middles, radii = cKDTree(vertices), start + along / 2, np.maximum(lengths / 2 - limit, 0)
    edge = np.flatnonzero(tree.query_ball_point(middles, radii, return_length=True))  # the ends are not in these balls
    near = tree.query_ball_point(middles[edge], radii[edge])
    edge = np.repeat(edge, [len(of_edge) for of_edge in near])
    vertex = np.concatenate([np.zeros(0, dtype=np.int64), *(np.asarray(of_edge, dtype=np.int64) for of_edge in near)])
    arms = vertices[vertex] - start[edge]
    shares = (arms * along[edge]).sum(axis=1) / np.maximum(lengths[edge], 1e-300) ** 2
    distances = np.linalg.norm(arms - shares[:, None] * along[edge], axis=1)
    lies = (distances <= limit) & (ends[edge] != vertex[:, None]).all(axis=1)
    edge, vertex, shares = edge[lies], vertex[lies], shares[lies]
    order = np.lexsort([-shares, edge])
    vertex, divided = vertex[order], ends[edge[order]]
    divided[1:, 1] = np.where(np.diff(edge[order]) == 0, vertex[:-1], divided[1:, 1])
    return vertex, divided


def _twins(vertices: np.ndarray, faces: np.ndarray) -> Int[Array, " h"] | None:
    """Return the half-edge that each half-edge (3 t,) of closed faces (t, 3) continues into; None if the faces are not closed.

    Half-edge 3 f + k leads from corner k of face f to the next one.
    """
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    is_forward = start < end
    key = np.minimum(start, end) * len(vertices) + np.maximum(start, end)
    order = np.lexsort([is_forward, key])
    starts = np.flatnonzero(np.append(True, np.diff(key[order]) > 0))
    counts = np.diff(np.append(starts, len(order)))
    if (np.add.reduceat(np.where(is_forward, 1, -1)[order], starts) != 0).any():
        return None
    twins = np.empty(len(order), dtype=np.int64)
    pairs = order[starts[counts == 2][:, None] + np.arange(2)]
    twins[pairs] = pairs[:, ::-1]
    for start, count in zip(starts[counts > 2], counts[counts > 2], strict=True):
        edge = order[start : start + count]
        for back, forth in _across_material(vertices, faces, edge, is_forward[edge]):
            twins[back], twins[forth] = forth, back
    return twins


def _across_material(
    vertices: np.ndarray, faces: np.ndarray, edge: np.ndarray, is_forward: np.ndarray
) -> list[tuple[int, int]]:
    """Return half-edges of one edge in pairs: around the edge, material lies between a backward and a forward one."""
    face, corner = edge // 3, edge % 3
    low = vertices[np.minimum(faces[face[0], corner[0]], faces[face[0], (corner[0] + 1) % 3])]
    high = vertices[np.maximum(faces[face[0], corner[0]], faces[face[0], (corner[0] + 1) % 3])]
    along = (high - low) / np.linalg.norm(high - low)
    arms = vertices[faces[face, (corner + 2) % 3]] - low
    arms -= np.outer(arms @ along, along)
    u = arms[np.argmax(np.linalg.norm(arms, axis=1))]
    turns = np.arctan2(arms @ np.cross(along, u), arms @ u) / (2 * np.pi)
    # Among coincident triangles the one that ends material comes first, so that flush blocks remain two.
    order = np.lexsort([~is_forward, np.round(turns / SAME_TURN) % (1 / SAME_TURN)])
    opened, pairs = list[int](), list[tuple[int, int]]()
    for half_edge in [*order, *order]:  # twice around
        if not is_forward[half_edge] and edge[half_edge] not in [back for back, _ in pairs] and half_edge not in opened:
            opened.append(half_edge)
        elif is_forward[half_edge] and opened and edge[half_edge] not in [forth for _, forth in pairs]:
            pairs.append((int(edge[opened.pop()]), int(edge[half_edge])))
    return pairs


def _apart(vertices: np.ndarray, faces: np.ndarray, twins: np.ndarray) -> trimesh.Trimesh:
    """Return closed faces whose corners share a vertex if a chain of twins connects their triangles."""
    half_edges = np.arange(len(twins))
    ends = half_edges - half_edges % 3 + (half_edges + 1) % 3
    ones = np.ones(len(twins), dtype=bool)
    graph = coo_array((ones, (half_edges, ends[twins])), shape=(len(twins), len(twins)))
    count, label = connected_components(graph, directed=False)
    if count == len(np.unique(faces)):
        return trimesh.Trimesh(vertices, faces, process=False)
    corner = np.empty(count, dtype=np.int64)
    corner[label] = faces.ravel()
    return trimesh.Trimesh(vertices[corner], label.reshape(-1, 3), process=False)
