"""The analytic surfaces that triangles approximate: stated by a file, or fitted to vertices."""

from collections.abc import Sequence

import numpy as np
import trimesh

from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Plane
from tolcontact.geometry.brep_face import FIT_TOLERANCE, are_one_surface
from tolcontact.geometry.edges import smooth_pieces
from tolcontact.geometry.files import BREP, FACE_NAMES, SURFACES
from tolcontact.geometry.fitting import fit_surface


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
        surface = (None if brep is None else mesh.metadata[SURFACES][label]) or _round_fit(mesh, triangles[rows])
        if surface is None:
            continue
        for number, earlier in enumerate(surfaces):  # files split round faces in halves
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
    if not are_one_surface(mesh, (earlier, earlier_faces), (surface, faces)):
        return None
    return _round_fit(mesh, np.concatenate([earlier_faces, faces])) if earlier.is_fitted else earlier


def _round_fit(mesh: trimesh.Trimesh, faces: np.ndarray) -> AnalyticSurface | None:
    surface = fit_surface(np.asarray(mesh.triangles)[faces], FIT_TOLERANCE)
    return None if isinstance(surface, Plane) else surface


def known_surfaces(mesh: trimesh.Trimesh) -> tuple[np.ndarray, list[AnalyticSurface | None], Sequence[str]] | None:
    """Return the B-rep face of each triangle (face,), from 0, their surfaces and their names; None without B-rep faces.

    There are no names if the file names no face.
    """
    brep = mesh.face_attributes.get(BREP)
    return None if brep is None else (np.asarray(brep).ravel(), mesh.metadata[SURFACES], mesh.metadata[FACE_NAMES])


def with_known_surfaces(
    vertices: np.ndarray, faces: np.ndarray, brep: np.ndarray, surfaces: list[AnalyticSurface | None], names: Sequence[str]
) -> trimesh.Trimesh:
    """Return a mesh with B-rep faces, from the results of `known_surfaces`."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.face_attributes[BREP] = brep
    mesh.metadata[SURFACES], mesh.metadata[FACE_NAMES] = surfaces, names
    return mesh
