"""A mesh whose coincident vertices are merged, except where different parts of a surface touch."""

from typing import NamedTuple

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from tolcontact.arrays import Array, Int
from tolcontact.geometry.tolerances import ROUNDING
from tolcontact.geometry.triangle_mesh import have_area

SAME_TURN = 1e-9  # of a full turn: largest angle between triangles at an edge that count as coincident


class MergedSurface(NamedTuple):
    """The triangles of a body that have an area, with merged vertices.

    sources    (t,): indices of these triangles in the body
    is_closed  whether each triangle of the body continues into others along all its edges
    """

    mesh: trimesh.Trimesh
    sources: Int[Array, " t"]
    is_closed: bool


def merged_surface(body: trimesh.Trimesh) -> MergedSurface:
    """Return the triangles of a body that have an area, with merged vertices.

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
    return MergedSurface(surface, sources[proper], twins is not None)


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
