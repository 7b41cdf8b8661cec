"""Vertices whose planes oppose each other, as where walls of a staircase that face opposite ways share a corner.

No displacement puts such a vertex on all its planes once these move into the material. Two vertices take its place, with an
edge between them that two of its facets share; nominally this edge has no length.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
import trimesh

from tolcontact.arrays import Array, Float, Int
from tolcontact.geometry.vertex_displacements import displacements

MIN_SINGULAR = 0.05  # of the planes around a vertex: directions with a smaller singular value are left alone
OPPOSED = 0.1  # of the motion of the planes: a vertex that lies further from one of them has to be divided
MAX_FACETS = 8  # around a vertex that is divided
CONSISTENT = 1e-6  # of the motion: how close a vertex comes to planes that do not oppose each other


class Divided(NamedTuple):
    """A mesh with several vertices for each one whose planes oppose each other.

    added      (a,): its triangles without an area; each fills the gap at an edge without length
    extended   (a,): a triangle in the plane of each
    """

    mesh: trimesh.Trimesh
    added: Int[Array, " a"]
    extended: Int[Array, " a"]


class Facet(NamedTuple):
    """A facet at a vertex.

    triangles   around the vertex, each followed by that across the edge to its third corner
    normal      outward, of unit length
    start, end  the other ends of its edges at the vertex, and their directions
    """

    triangles: list[int]
    normal: Float[Array, " 3"]
    start: int
    end: int
    to_start: Float[Array, " 3"]
    to_end: Float[Array, " 3"]

    def widens_at_end(self, jog: Float[Array, " 3"]) -> bool | None:
        """Return whether an edge `jog` in place of the vertex adds area at its end, or at its start; None if at neither."""
        at_end, at_start = (np.cross(arm, jog) @ self.normal > 0 for arm in (self.to_end, self.to_start))
        return True if at_end else False if at_start else None


class Cut(NamedTuple):
    """A cut between the facets around a vertex. Those between the first and the last facet get a new vertex.

    first, last      the facets that share the edge between the vertices; whether the new edge adds area at their ends
    are_whole        whether the planes of the half with the new vertex, and of the other one, do not oppose each other
    """

    first: int
    last: int
    first_at_end: bool
    last_at_end: bool
    are_whole: tuple[bool, bool]


def divided(mesh: trimesh.Trimesh, same_plane: float) -> Divided:
    """Return a mesh whose vertices can follow all their planes; triangles at an angle below `same_plane` [rad] are in one."""
    vertices, faces, normals = list(mesh.vertices), list(np.array(mesh.faces)), list(np.asarray(mesh.face_normals))
    count, extended = len(faces), list[int]()
    is_flat = np.asarray(mesh.face_adjacency_angles) <= same_plane
    label = list(trimesh.graph.connected_component_labels(np.asarray(mesh.face_adjacency)[is_flat], node_count=count))
    waiting = [int(v) for v in np.flatnonzero(_oppose(np.array(faces), np.array(normals), len(vertices)))]
    around = defaultdict[int, list[int]](list)  # the triangles around a vertex
    for triangle, vertex in np.argwhere(np.isin(mesh.faces, waiting)):
        around[int(mesh.faces[triangle, vertex])].append(int(triangle))
    while waiting:
        v, twin = waiting.pop(), len(vertices)
        facets = _facets(v, around[v], vertices, faces, normals, label)
        cut = min(_cuts(facets), default=(0, 0.0, None))[2]
        if cut is None:
            continue
        vertices.append(vertices[v])
        waiting.extend(vertex for vertex, is_whole in zip((twin, v), cut.are_whole, strict=True) if not is_whole)
        first, last = facets[cut.first], facets[cut.last]
        moved = [
            *facets[cut.first + 1 : cut.last],
            *([] if cut.first_at_end else [first]),
            *([last] if cut.last_at_end else []),
        ]
        around[twin] = [triangle for facet in moved for triangle in facet.triangles]
        around[v] = [triangle for triangle in around[v] if triangle not in around[twin]]
        for triangle in around[twin]:
            faces[triangle] = np.where(faces[triangle] == v, twin, faces[triangle])
        for facet, at_end, ends in ((first, cut.first_at_end, (v, twin)), (last, cut.last_at_end, (twin, v))):
            triangle = facet.triangles[0]
            faces.append(np.array([ends[0], facet.end if at_end else facet.start, ends[1]]))
            for vertex in faces[-1]:
                around[int(vertex)].append(len(faces) - 1)
            normals.append(normals[triangle])
            label.append(label[triangle])
            extended.append(triangle if triangle < count else extended[triangle - count])
    added = np.arange(count, len(faces))
    whole = trimesh.Trimesh(np.array(vertices), np.array(faces), process=False) if added.size else mesh
    return Divided(whole, added, np.array(extended, dtype=int))


def _oppose(faces: np.ndarray, normals: np.ndarray, count: int) -> np.ndarray:
    """Return whether the planes around each vertex (count,) oppose each other."""
    N = normals.repeat(3, axis=0)
    u = displacements(faces.ravel(), N, np.ones((len(N), 1)), count, MIN_SINGULAR)[..., 0]
    oppose = np.zeros(count, dtype=bool)
    np.logical_or.at(oppose, faces.ravel(), np.abs((N * u[faces.ravel()]).sum(axis=1) - 1) > OPPOSED)
    return oppose


def _facets(
    v: int,
    there: Sequence[int],
    vertices: Sequence[np.ndarray],
    faces: Sequence[np.ndarray],
    normals: Sequence[np.ndarray],
    label: Sequence[int],
) -> list[Facet]:
    """Return the facets around a vertex v, whose triangles are `there`; none if the mesh is open there."""
    corners = [np.roll(faces[triangle], -int(np.flatnonzero(faces[triangle] == v)[0])) for triangle in there]
    following, order = {int(corner[1]): k for k, corner in enumerate(corners)}, [0]
    while (k := following.get(int(corners[order[-1]][2]), 0)) not in order:
        order.append(k)
    if len(order) < len(there) or following.get(int(corners[order[-1]][2])) != 0:
        return []
    labels = [label[there[k]] for k in order]
    starts = [k for k in range(len(order)) if labels[k] != labels[k - 1]]
    facets = []
    for start, end in zip(starts, [*starts[1:], *(k + len(order) for k in starts[:1])], strict=True):
        of_facet = [order[k % len(order)] for k in range(start, end)]
        ends = int(corners[of_facet[0]][1]), int(corners[of_facet[-1]][2])
        triangles = [there[k] for k in of_facet]
        facets.append(Facet(triangles, normals[triangles[0]], *ends, *(vertices[other] - vertices[v] for other in ends)))
    return facets


def _cuts(facets: Sequence[Facet]) -> Iterator[tuple[int, float, Cut]]:
    """Yield cuts, with the number of vertices that they end in, and the sum of the squares of their motions."""
    count, normals = len(facets), np.array([facet.normal for facet in facets])

    @cache
    def vertices_of(planes: tuple[int, ...]) -> list[tuple[tuple[int, ...], np.ndarray]]:
        """Return the planes around each vertex that some planes around one need, and its motion (3,) if they move by 1.

        Cuts leave the fewest vertices; there are none if no cut helps.
        """
        N = normals[list(planes)]
        u = np.linalg.lstsq(N, np.ones(len(N)), rcond=MIN_SINGULAR)[0]
        if np.abs(N @ u - 1).max() < CONSISTENT:
            return [(planes, u)]
        cuts = (cut for cut in combinations(range(len(planes)), 2) if cut[1] - cut[0] not in (1, len(planes) - 1))
        halves = (
            (vertices_of(planes[first : last + 1]), vertices_of(planes[last:] + planes[: first + 1])) for first, last in cuts
        )
        return min(([*left, *right] for left, right in halves if left and right), key=len, default=[])

    for first, last in combinations(range(count if count <= MAX_FACETS else 0), 2):
        if last - first in (1, count - 1):
            continue
        halves = [
            vertices_of(tuple(k % count for k in range(*side))) for side in ((first, last + 1), (last, first + count + 1))
        ]
        if not all(halves):
            continue
        u, other_u = (next(u for planes, u in half if first in planes and last in planes) for half in halves)
        first_at_end, last_at_end = facets[first].widens_at_end(other_u - u), facets[last].widens_at_end(u - other_u)
        if first_at_end is not None and last_at_end is not None:
            motions = sum(float(u @ u) for half in halves for _, u in half)
            are_whole = len(halves[0]) == 1, len(halves[1]) == 1
            yield len(halves[0]) + len(halves[1]), motions, Cut(first, last, first_at_end, last_at_end, are_whole)
