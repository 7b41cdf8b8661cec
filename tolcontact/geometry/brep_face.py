"""Faces of a part, B-rep faces of a STEP file or smooth pieces of a mesh: their surfaces and descriptions. Lengths in mm."""

from collections.abc import Sequence

import numpy as np
import trimesh

from tolcontact.declaration.values import Vector
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Plane, Sphere, Torus
from tolcontact.geometry.face_groups import GENERAL, FaceInFile, FaceOnSurface, are_one_surface, grouped
from tolcontact.geometry.files import BREP, STATED_FACES
from tolcontact.geometry.files.step_shapes import FaceMeasure, StatedFace
from tolcontact.geometry.fitting import fit_surface
from tolcontact.geometry.tolerances import ROUNDING
from tolcontact.geometry.triangle_mesh import smooth_pieces

FIT_TOLERANCE = 1e-3  # [mm] largest distance of the vertices of a face from its surface
PIECES = "pieces"
DESCRIPTIONS = "descriptions"
ON_SURFACES = "on_surfaces"


def number_faces(mesh: trimesh.Trimesh) -> tuple[np.ndarray, Sequence[StatedFace]]:
    """Return the index of each triangle's face (face,), and the faces as a STEP file states them.

    The faces of other meshes are their smooth pieces, which the mesh caches.
    """
    if BREP in mesh.face_attributes:
        return np.asarray(mesh.face_attributes[BREP]).ravel(), mesh.metadata[STATED_FACES]
    if PIECES not in mesh.metadata:
        mesh.metadata[PIECES] = smooth_pieces(mesh, np.arange(len(mesh.faces)))
    pieces = mesh.metadata[PIECES]
    return pieces, [StatedFace()] * (int(pieces.max(initial=-1)) + 1)


def describe_faces(mesh: trimesh.Trimesh) -> tuple[FaceInFile, ...]:
    """Return the faces of a part. Its mesh caches them, since fitting surfaces takes time."""
    if DESCRIPTIONS not in mesh.metadata:
        face_of, stated_faces = number_faces(mesh)
        on_surfaces = faces_on_surfaces(mesh)
        faces = [
            _description(number, surface, stated, stated.measure or _measure(mesh, triangles, surface))
            for number, (stated, (surface, triangles)) in enumerate(zip(stated_faces, on_surfaces, strict=True), start=1)
        ]
        mesh.metadata[DESCRIPTIONS] = tuple(
            grouped(mesh, face_of, faces, on_surfaces) if BREP in mesh.face_attributes else faces
        )
    return mesh.metadata[DESCRIPTIONS]  # type: ignore[no-any-return]


def faces_on_surfaces(mesh: trimesh.Trimesh) -> Sequence[FaceOnSurface]:
    """Return the stated or fitted surface and the triangles of each face of a part. Its mesh caches them."""
    if ON_SURFACES not in mesh.metadata:
        face_of, stated = number_faces(mesh)
        order = np.argsort(face_of, kind="stable")
        groups = np.split(order, np.searchsorted(face_of[order], np.arange(1, len(stated))))
        corners = np.asarray(mesh.triangles)
        surfaces = [
            face.surface or (fit_surface(corners[triangles], FIT_TOLERANCE) if len(triangles) else None)
            for triangles, face in zip(groups, stated, strict=True)
        ]
        mesh.metadata[ON_SURFACES] = tuple(zip(surfaces, groups, strict=True))
    return mesh.metadata[ON_SURFACES]  # type: ignore[no-any-return]


def faces_at(mesh: trimesh.Trimesh, point: Vector) -> tuple[list[int], float]:
    """Return the face numbers nearest to a point, several where faces meet, and the distance of these faces [mm]."""
    face_of, _ = number_faces(mesh)
    copies = np.tile(point, (len(face_of), 1))
    distances = np.linalg.norm(trimesh.triangles.closest_point(mesh.triangles, copies) - copies, axis=1)
    nearest = np.unique(face_of[distances < distances.min() + ROUNDING * mesh.scale])
    return [int(number) + 1 for number in nearest], float(distances.min())


def _measure(mesh: trimesh.Trimesh, triangles: np.ndarray, surface: AnalyticSurface | None) -> FaceMeasure:
    """Return the measure of a face from its `triangles` (face,): its point is the largest one's centre, on its surface."""
    if not len(triangles):
        return FaceMeasure(
            0.0, np.zeros(3) if surface is None else surface.project(np.zeros((1, 3)))[0], np.array([0.0, 0.0, 1.0])
        )
    areas = np.asarray(mesh.area_faces)[triangles]
    largest = triangles[areas.argmax()]
    point = np.asarray(mesh.triangles_center)[largest]
    point = point if surface is None else surface.project(point[None])[0]
    return FaceMeasure(float(areas.sum()), point, np.asarray(mesh.face_normals)[largest])


def _description(number: int, surface: AnalyticSurface | None, stated: StatedFace, measure: FaceMeasure) -> FaceInFile:
    """Return the description of a face on a `surface`, None if none is known."""
    point, area = plain_vector(measure.point), measure.area
    if surface is None:
        return FaceInFile(number, GENERAL, point, None, None, False, area, name=stated.name, copies=stated.copies)
    _, outward = surface.distance(measure.point[None] + 1e-6 * measure.normal)
    is_inward = float(outward[0] @ measure.normal) < 0
    is_plane = isinstance(surface, Plane)
    direction = None if isinstance(surface, Sphere) else plain_vector(-surface.axis if is_plane and is_inward else surface.axis)
    return FaceInFile(
        number,
        surface.kind,
        point,
        direction,
        radius=surface.radius if "radius" in surface.sizes else None,
        is_inner=is_inward and not is_plane,
        area=area,
        centre=None if is_plane else plain_vector(_centre(surface, measure.point)),
        residual=surface.residual,
        name=stated.name,
        copies=stated.copies,
    )


def _centre(surface: AnalyticSurface, point: np.ndarray) -> np.ndarray:
    """Return the centre (3,) of a sphere or torus, or the projection of a point (3,) on the axis of a cylinder or cone."""
    if isinstance(surface, Sphere | Torus):
        return surface.origin
    return np.asarray(surface.origin + float(surface.along(point)) * surface.axis)


def plain_vector(numbers: np.ndarray) -> Vector:
    """Return three numbers in the form used in scripts."""
    x, y, z = (float(number) + 0.0 for number in numbers)
    return x, y, z


def analytic_surfaces(mesh: trimesh.Trimesh, triangles: np.ndarray) -> tuple[list[AnalyticSurface], np.ndarray]:
    """Return the analytic surfaces of triangles (face,) of a mesh, and the index of each triangle's surface, -1 for none.

    A STEP file states the surfaces of its B-rep faces. Where it does not, and for smooth pieces of other meshes, they are
    fitted. Planes need no fit: flat triangles are exact.
    """
    surfaces: list[AnalyticSurface] = []
    numbers = np.full(len(triangles), -1)
    brep = mesh.face_attributes.get(BREP)
    group = smooth_pieces(mesh, triangles) if brep is None else np.asarray(brep).ravel()[triangles]
    for label in np.unique(group):
        rows = np.flatnonzero(group == label)
        surface = (None if brep is None else mesh.metadata[STATED_FACES][label].surface) or _round_fit(mesh, triangles[rows])
        if surface is None:
            continue
        for number, earlier in enumerate(surfaces):  # files split round faces in halves
            members = triangles[numbers == number]
            if are_one_surface(mesh, (earlier, members), (surface, triangles[rows])):
                union = _round_fit(mesh, np.concatenate([members, triangles[rows]])) if earlier.is_fitted else earlier
                if union is not None:
                    surfaces[number], numbers[rows] = union, number
                    break
        else:
            numbers[rows] = len(surfaces)
            surfaces.append(surface)
    return surfaces, numbers


def _round_fit(mesh: trimesh.Trimesh, faces: np.ndarray) -> AnalyticSurface | None:
    surface = fit_surface(np.asarray(mesh.triangles)[faces], FIT_TOLERANCE)
    return None if isinstance(surface, Plane) else surface


def known_surfaces(mesh: trimesh.Trimesh) -> tuple[np.ndarray, list[AnalyticSurface | None], Sequence[str]] | None:
    """Return the B-rep face of each triangle (face,), from 0, their surfaces and their names; None without B-rep faces.

    There are no names if the file names no face.
    """
    if BREP not in mesh.face_attributes:
        return None
    face_of, faces = number_faces(mesh)
    names = tuple(face.name for face in faces)
    return face_of, [face.surface for face in faces], names if any(names) else ()


def with_known_surfaces(
    vertices: np.ndarray, faces: np.ndarray, brep: np.ndarray, surfaces: list[AnalyticSurface | None], names: Sequence[str]
) -> trimesh.Trimesh:
    """Return a mesh with B-rep faces, from the results of `known_surfaces`."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.face_attributes[BREP] = brep
    stated = zip(surfaces, names or [""] * len(surfaces), strict=True)
    mesh.metadata[STATED_FACES] = tuple(StatedFace(surface, name) for surface, name in stated)
    return mesh
