"""The solid of each part, with the features that move its faces."""

from collections.abc import Iterator, Sequence

import numpy as np
import trimesh

from tolcontact.discretization import Nominal, NominalPart
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Cylinder, Plane
from tolcontact.geometry.brep_face import known_surfaces
from tolcontact.geometry.surface import Surface
from tolcontact.interference.deviating_solid import DeviatingSolid, deviating_solid
from tolcontact.interference.solid import Solid, solid
from tolcontact.vocabulary import ROUNDED


def part_solid(nominal: Nominal, index: int) -> DeviatingSolid | None:
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
    return deviating_solid(body, faces, _bulges(body, surface_of_body, round_faces), cylinders)


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
