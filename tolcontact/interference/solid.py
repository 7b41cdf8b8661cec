"""Bodies for the interference test: triangles slightly inside the surface, edges between planes, and deviations of faces."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import trimesh

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Cylinder, Plane
from tolcontact.geometry.brep_face import known_surfaces
from tolcontact.geometry.inset import smaller
from tolcontact.geometry.polyhedron import merged_surface
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.triangle_mesh import coordinate_error, edges
from tolcontact.geometry.vertex_displacements import SAME_PLANE, capped, displacements
from tolcontact.interference.opposing_planes import MIN_SINGULAR, divided
from tolcontact.vocabulary import ROUNDED

MAX_SHIFT = 8.0  # insets: the largest motion of a vertex, for needles
IN_PLANE = 1e-9  # of the largest motion of a vertex: a motion along the normal that is rounding


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed body in its nominal place, and the deviations that move its faces.

    vertices    (v, 3) [mm]
    faces       (t, 3): triangles
    edges       (e, 2): edges between different planes
    sides       (e, 2): the triangles at each edge, the same one twice where the other has no area
    flat        (n, 2): triangles that share an edge and lie in one plane
    sources     (t,): the triangle of the part's mesh that each triangle is
    normals     (t, 3) outward, of unit length; triangles without an area have the normal of their plane
    columns     (k,) of the deviations that move its faces
    motions     (m,), (m, 3, k) [mm]: the vertices that deviations move, and how far for unit deviations
    bulges      (t,) [mm]: how far triangles of hollow round faces protrude into the hollow
    cylinders   that are known to contain some of its triangles
    """

    vertices: Float[Array, "v 3"]
    faces: Int[Array, "t 3"]
    edges: Int[Array, "e 2"]
    sides: Int[Array, "e 2"]
    flat: Int[Array, "n 2"]
    sources: Int[Array, " t"]
    normals: Float[Array, "t 3"]
    columns: Int[Array, " k"]
    motions: tuple[Int[Array, " m"], Float[Array, "m 3 k"]]
    bulges: Float[Array, " t"]
    cylinders: tuple[Cylinder, ...] = ()

    @cached_property
    def components(self) -> list[Int[Array, " _"]]:
        """The vertices of each connected component."""
        sides = self.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
        labels = np.asarray(trimesh.graph.connected_component_labels(sides, node_count=len(self.vertices)))
        used = np.unique(self.faces)
        order = used[np.argsort(labels[used], kind="stable")]
        return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)

    @property
    def corners(self) -> Float[Array, "t 3 3"]:
        """The corners of the triangles [mm]."""
        return self.vertices[self.faces]

    @property
    def motions_of_vertices(self) -> Float[Array, "v 3 k"]:
        """How far unit deviations move all vertices [mm]."""
        motions = np.zeros((len(self.vertices), 3, len(self.columns)))
        motions[self.motions[0]] = self.motions[1]
        return motions

    @property
    def varies(self) -> bool:
        """Whether faces deviate."""
        return bool(self.columns.size)

    @cached_property
    def moves(self) -> Bool[Array, " t"]:
        """Whether deviations move the plane of each triangle (t,); corners may move in it."""
        heights = np.abs(np.einsum("tj,tcjk->tck", self.normals, self.motions_of_vertices[self.faces]))
        return np.asarray((heights > IN_PLANE * np.abs(self.motions[1]).max(initial=0)).any(axis=(1, 2)))

    @cached_property
    def facet_of(self) -> Int[Array, " t"]:
        """The facet of each triangle (t,): neighbours in one plane are one facet, unless deviations move their planes."""
        pairs = self.flat[~self.moves[self.flat].any(axis=1)]
        return np.asarray(trimesh.graph.connected_component_labels(pairs, node_count=len(self.faces)), dtype=np.int64)

    @cached_property
    def first_of_facet(self) -> Int[Array, " f"]:
        """A triangle of each facet."""
        return np.unique(self.facet_of, return_index=True)[1]

    def growth(self, deviations: Float[Array, "n contributor"]) -> float:
        """Return how far [mm] deviations (n, contributor) move any vertex at most."""
        if not self.varies:
            return 0.0
        lengths = np.linalg.norm(self.motions[1], axis=1).max(axis=0, initial=0)
        return float((np.abs(deviations[:, self.columns]) @ lengths).max(initial=0))

    def _shifts(self, triangles: Int[Array, " m"], motions: Float[Array, "m 3 3 k"]) -> Float[Array, "v 3 k"]:
        """Return how vertices move as `motions` of the corners of `triangles`, all that meet in them, displace their planes.

        A vertex stays on all planes around it (see `displacements`). Each of the k columns is a separate case.
        """
        N, vectors = self.normals[triangles].repeat(3, axis=0), motions.reshape(3 * len(triangles), 3, motions.shape[3])
        heights = np.einsum("pj,pjk->pk", N, vectors)
        return displacements(self.faces[triangles].ravel(), N, heights, len(self.vertices), MIN_SINGULAR, vectors)

    def inset(self, depth: float) -> "Solid":
        """Return the body with vertices that put its surface `depth` [mm] deeper, and inside round faces.

        A vertex moves by no more than MAX_SHIFT times the largest of these depths.
        """
        depths = depth + self.bulges
        motions = (-depths[:, None] * self.normals)[:, None].repeat(3, axis=1)
        shifts = self._shifts(np.arange(len(self.faces)), motions[..., None])[..., 0]
        vertices = self.vertices + capped(shifts, MAX_SHIFT * float(depths.max(initial=0.0)))
        inset = replace(self, vertices=np.ascontiguousarray(vertices))
        # These properties do not depend on where vertices are: they are found once for a part, not for each of its neighbours.
        inset.__dict__.update(
            components=self.components, moves=self.moves, facet_of=self.facet_of, first_of_facet=self.first_of_facet
        )
        return inset

    def deviating(
        self,
        faces: Sequence[tuple[Int[Array, " m"], Int[Array, " k"], Float[Array, "m 3 3 k"]]],
        bulges: Float[Array, " t"],
        cylinders: Sequence[Cylinder] = (),
    ) -> "Solid":
        """Return the body with faces that deviate: triangles, columns and motions of the corners of each face.

        Its vertices stay on all planes that meet in them, wherever these planes move.
        """
        columns = np.unique(np.concatenate([np.zeros(0, dtype=int), *(face[1] for face in faces)]))
        is_moved = np.zeros(len(self.vertices), dtype=bool)
        for triangles, _, _ in faces:
            is_moved[self.faces[triangles]] = True
        around = np.flatnonzero(is_moved[self.faces].any(axis=1))
        motions = np.zeros((len(around), 3, 3, len(columns)))
        for triangles, of_face, motion in faces:
            rows = np.searchsorted(around, triangles)
            motions[np.ix_(rows, np.arange(3), np.arange(3), np.searchsorted(columns, of_face))] += motion
        shifts = self._shifts(around, motions)
        moved = np.flatnonzero(np.abs(shifts).max(axis=(1, 2), initial=0) > 0)
        return replace(self, columns=columns, motions=(moved, shifts[moved]), bulges=bulges, cylinders=tuple(cylinders))


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
        columns=np.zeros(0, dtype=int),
        motions=(np.zeros(0, dtype=int), np.zeros((0, 3, 0))),
        bulges=np.zeros(len(faces)),
    )


def part_solid(nominal: Nominal, index: int) -> Solid | None:
    """Return the solid of a part of the nominal assembly; None if it is not closed.

    Faces of features deviate, without their form deviations. Triangles of hollow round faces protrude into the hollow, and the
    solid does not.
    """
    body = solid(nominal.parts[index].body)
    if body is None:
        return None
    stored = nominal.parts[index].body
    surface_of_body = Surface(trimesh.Trimesh(stored.vertices, np.asarray(stored.faces)[body.sources], process=False))
    faces = list(_deviating_faces(nominal, index, body, surface_of_body))
    round_faces = list(_round_faces(nominal, nominal.parts[index], body, surface_of_body))
    cylinders = [surface for surface, _ in round_faces if isinstance(surface, Cylinder)]
    return body.deviating(faces, _bulges(body, surface_of_body, round_faces), cylinders)


def _deviating_faces(
    nominal: Nominal, index: int, body: Solid, surface_of_body: Surface
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield triangles (m,) of each face that deviates, columns (k,), and how its corners move (m, 3, 3, k)."""
    part, expansion = nominal.parts[index], nominal.expansion(index)
    if expansion is not None:
        motion = np.multiply.outer(body.vertices[body.faces] - part.placement[1], expansion.coefficients)
        yield np.arange(len(body.faces)), expansion.columns, motion
    for feature in nominal.features:
        if nominal.parts[feature.part].part is not part.part or not feature.varies:
            continue
        for number, surface in enumerate(feature.surfaces):
            face = feature.deviation(number, part.placement)
            columns = np.setdiff1d(np.arange(len(face.columns)), face.modes)
            placed = surface.placed(*part.placement)
            triangles = _triangles(surface_of_body, placed)
            corners, facets = body.vertices[body.faces[triangles]].reshape(-1, 3), body.normals[triangles].repeat(3, axis=0)
            normals = facets.copy()  # along which sizes move corners: those of a shaft stay on it, facets of a bore behind it
            for piece in placed.pieces:
                if not (piece.is_hollow or isinstance(piece.surface, Plane)):
                    rows = np.isin(triangles, _triangles(surface_of_body, piece.face)).repeat(3)
                    _, slope = piece.surface.distance(corners[rows])
                    normals[rows] = slope * np.sign((slope * facets[rows]).sum(axis=1, keepdims=True))
            tau, rho = face.twist[:3, columns], face.twist[3:, columns]
            motion = tau.T + np.cross(rho.T, (corners - face.centre)[:, None]) + normals[:, None] * face.height[columns, None]
            yield triangles, face.columns[columns], motion.swapaxes(1, 2).reshape(len(triangles), 3, 3, len(columns))


def _bulges(body: Solid, surface_of_body: Surface, round_faces: Sequence[tuple[AnalyticSurface, np.ndarray]]) -> np.ndarray:
    """Return how far (t,) [mm] triangles protrude from the round faces that they represent, mostly into hollow ones."""
    bulges = np.zeros(len(body.faces))
    corners = np.asarray(surface_of_body.mesh.triangles)
    points = np.concatenate(
        [corners, (corners + np.roll(corners, -1, axis=1)) / 2, corners.mean(axis=1, keepdims=True)], axis=1
    )
    for surface, rows in round_faces:
        distance, _ = surface.distance(points[rows].reshape(-1, 3))
        _, slope = surface.distance(points[rows, -1])
        outward = np.where((slope * body.normals[rows]).sum(axis=1) < 0, -1.0, 1.0)
        height = float((distance.reshape(len(rows), -1) * outward[:, None]).max(initial=0))
        # One height for all triangles of a face: their planes are nearly the same, and meet far away if they move differently.
        bulges[rows] = np.maximum(bulges[rows], height if height > ROUNDED else 0.0)
    return bulges


def _round_faces(
    nominal: Nominal, part: NominalPart, body: Solid, surface_of_body: Surface
) -> Iterator[tuple[AnalyticSurface, np.ndarray]]:
    """Yield the round surfaces of a part in the nominal assembly, and the triangles (m,) of its solid that represent them."""
    faces_of_file = known_surfaces(part.mesh)
    if faces_of_file is not None:
        numbers, surfaces, _ = faces_of_file
        for number, surface in enumerate(surfaces):
            if surface is not None and not isinstance(surface, Plane):
                yield surface.placed(*part.placement), np.flatnonzero(numbers[body.sources] == number)
    for pair in nominal.pairs:
        for body_of_face, face in ((pair.moving, pair.moving_face), (pair.reference, pair.reference_face)):
            if face is not None and body_of_face is not None and nominal.parts[body_of_face].part is part.part:
                for piece in face.pieces:
                    if piece.surface.is_fitted and not isinstance(piece.surface, Plane):
                        yield piece.surface, _triangles(surface_of_body, piece.face)


def curved_triangles(body: Solid, face: Surface) -> np.ndarray:
    """Return the triangles (m,) of a body that form the round surfaces of a face."""
    surface_of_body = Surface(trimesh.Trimesh(body.vertices, body.faces, process=False))
    pieces = [piece for piece in face.pieces if not isinstance(piece.surface, Plane)]
    return np.concatenate([np.zeros(0, dtype=int), *(_triangles(surface_of_body, piece.face) for piece in pieces)])


def _triangles(surface_of_body: Surface, face: Surface) -> np.ndarray:
    """Return the triangles (m,) of a body that form one of its faces."""
    return np.unique(surface_of_body.nearest(np.asarray(face.mesh.triangles_center))[0])
