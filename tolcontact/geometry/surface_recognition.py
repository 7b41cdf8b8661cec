"""The analytic surfaces for which triangles stand: a file states them, or they are fitted to vertices."""

from collections.abc import Sequence

import numpy as np
import trimesh

from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Plane
from tolcontact.geometry.brep_face import FIT_TOLERANCE
from tolcontact.geometry.edges import smooth_pieces
from tolcontact.geometry.files import BREP, FACE_NAMES, SURFACES
from tolcontact.geometry.fitting import fit_surface

RESIDUAL_FACTOR = 10  # times the residuals of two faces: distance at which they still are parts of one surface
POSITION_TOLERANCE = 1e-9  # of a part's size: distance between faces of one surface


def analytic_surfaces(mesh: trimesh.Trimesh, triangles: np.ndarray) -> tuple[list[AnalyticSurface], np.ndarray]:
    """Return the analytic surfaces of some triangles (face,) of a mesh, and the number of the surface of each, -1 for none.

    A STEP file states the surfaces of its B-rep faces. Where it does not, and for smooth pieces of other meshes, they are
    fitted. Planes are not: flat triangles are exact.
    """
    surfaces: list[AnalyticSurface] = []
    numbers = np.full(len(triangles), -1)
    brep = mesh.face_attributes.get(BREP)
    group = smooth_pieces(mesh, triangles) if brep is None else np.asarray(brep).ravel()[triangles]
    for label in np.unique(group):
        rows = np.flatnonzero(group == label)
        surface = (None if brep is None else mesh.metadata[SURFACES][label]) or _round_fit(mesh, triangles[rows])
        if surface is None:
            continue
        for number, earlier in enumerate(surfaces):  # round faces come in halves
            union = _union(mesh, earlier, surface, triangles[numbers == number], triangles[rows])
            if union is not None:
                surfaces[number], numbers[rows] = union, number
                break
        else:
            numbers[rows] = len(surfaces)
            surfaces.append(surface)
    return surfaces, numbers


def _union(
    mesh: trimesh.Trimesh,
    earlier: AnalyticSurface,
    surface: AnalyticSurface,
    earlier_faces: np.ndarray,
    faces: np.ndarray,
) -> AnalyticSurface | None:
    """Return the common surface of two groups of triangles (face,), None if they are not parts of one surface."""
    if (
        earlier.kind != surface.kind
        or earlier.is_fitted != surface.is_fitted
        or _is_outside(mesh, earlier, earlier_faces) != _is_outside(mesh, earlier, faces)
    ):
        return None
    vertices = np.asarray(mesh.vertices)[np.unique(mesh.faces[faces])]
    distance = np.abs(earlier.distance(vertices)[0]).max()
    if distance > RESIDUAL_FACTOR * (earlier.residual + surface.residual) + POSITION_TOLERANCE * mesh.scale:
        return None
    return _round_fit(mesh, np.concatenate([earlier_faces, faces])) if earlier.is_fitted else earlier


def _is_outside(mesh: trimesh.Trimesh, surface: AnalyticSurface, faces: np.ndarray) -> bool:
    """Return whether the outside of some triangles (face,) is the outside of the surface."""
    _, slope = surface.distance(np.asarray(mesh.triangles_center)[faces])
    return bool((slope * np.asarray(mesh.face_normals)[faces]).sum() > 0)


def _round_fit(mesh: trimesh.Trimesh, faces: np.ndarray) -> AnalyticSurface | None:
    surface = fit_surface(np.asarray(mesh.triangles)[faces], FIT_TOLERANCE)
    return None if isinstance(surface, Plane) else surface


def known_surfaces(mesh: trimesh.Trimesh) -> tuple[np.ndarray, list[AnalyticSurface | None], Sequence[str]] | None:
    """Return the B-rep face of each triangle (face,), from 0, their surfaces and their names; None if there are no B-rep faces.

    The names are empty if the file names no face.
    """
    brep = mesh.face_attributes.get(BREP)
    return None if brep is None else (np.asarray(brep).ravel(), mesh.metadata[SURFACES], mesh.metadata[FACE_NAMES])


def with_known_surfaces(
    vertices: np.ndarray, faces: np.ndarray, brep: np.ndarray, surfaces: list[AnalyticSurface | None], names: Sequence[str]
) -> trimesh.Trimesh:
    """Return a mesh with B-rep faces, from what `known_surfaces` returned."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.face_attributes[BREP] = brep
    mesh.metadata[SURFACES], mesh.metadata[FACE_NAMES] = surfaces, names
    return mesh
