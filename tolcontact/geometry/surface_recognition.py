"""Which triangles of a face stand for surfaces that are known exactly: a file states them, or they are fitted to vertices."""

from collections.abc import Sequence

import numpy as np
import trimesh

from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Plane
from tolcontact.geometry.brep_face import FIT
from tolcontact.geometry.edges import smooth_pieces
from tolcontact.geometry.files import BREP, FACE_NAMES, SURFACES
from tolcontact.geometry.fitting import fit_surface

ALIKE = 10  # times as far as they were fitted may faces be off each other's surface that are taken for one
SAME = 1e-9  # of a part's size: faces that are no farther off each other's surface are parts of one


def analytic_surfaces(mesh: trimesh.Trimesh, chosen: np.ndarray) -> tuple[list[AnalyticSurface], np.ndarray]:
    """Surfaces, and for each of the `chosen` triangles (face,) of a mesh the number of the one that it stands for; -1 if none.

    Of a STEP file they are those of its B-rep faces; what it does not state, and smooth pieces of other meshes, are fitted.
    Planes are not fitted: flat triangles are exact.
    """
    surfaces: list[AnalyticSurface] = []
    surface_numbers = np.full(len(chosen), -1)
    brep = mesh.face_attributes.get(BREP)
    group = smooth_pieces(mesh, chosen) if brep is None else np.asarray(brep).ravel()[chosen]
    for number in np.unique(group):
        own = np.flatnonzero(group == number)
        surface = (None if brep is None else mesh.metadata[SURFACES][number]) or _fitted(mesh, chosen[own])
        if surface is None:
            continue
        for k, known in enumerate(surfaces):  # round faces come in halves
            one = _one(mesh, known, surface, chosen[surface_numbers == k], chosen[own])
            if one is not None:
                surfaces[k], surface_numbers[own] = one, k
                break
        else:
            surface_numbers[own] = len(surfaces)
            surfaces.append(surface)
    return surfaces, surface_numbers


def _one(
    mesh: trimesh.Trimesh, known: AnalyticSurface, surface: AnalyticSurface, faces: np.ndarray, own: np.ndarray
) -> AnalyticSurface | None:
    """The surface that two faces are parts of, the triangles (face,) of each; None if they are not parts of one."""
    if (
        known.kind != surface.kind
        or known.is_fitted != surface.is_fitted
        or _looks_out(mesh, known, faces) != _looks_out(mesh, known, own)
    ):
        return None
    off = np.abs(known.distance(np.asarray(mesh.vertices)[np.unique(mesh.faces[own])])[0]).max()
    if off > ALIKE * (known.residual + surface.residual) + SAME * mesh.scale:
        return None
    return _fitted(mesh, np.concatenate([faces, own])) if known.is_fitted else known


def _looks_out(mesh: trimesh.Trimesh, surface: AnalyticSurface, own: np.ndarray) -> bool:
    """Whether the outside of some triangles (face,) is that of the surface."""
    _, slope = surface.distance(np.asarray(mesh.triangles_center)[own])
    return bool((slope * np.asarray(mesh.face_normals)[own]).sum() > 0)


def _fitted(mesh: trimesh.Trimesh, own: np.ndarray) -> AnalyticSurface | None:
    surface = fit_surface(np.asarray(mesh.triangles)[own], FIT)
    return None if surface is None or isinstance(surface, Plane) else surface


def known_surfaces(mesh: trimesh.Trimesh) -> tuple[np.ndarray, list[AnalyticSurface | None], Sequence[str]] | None:
    """Of a mesh from a STEP file the B-rep face of each triangle (face,), from 0, their surfaces, and names if there are any.

    None of other meshes.
    """
    brep = mesh.face_attributes.get(BREP)
    return None if brep is None else (np.asarray(brep).ravel(), mesh.metadata[SURFACES], mesh.metadata[FACE_NAMES])


def with_known_surfaces(
    vertices: np.ndarray, faces: np.ndarray, brep: np.ndarray, surfaces: list[AnalyticSurface | None], names: Sequence[str]
) -> trimesh.Trimesh:
    """A mesh that knows them again."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.face_attributes[BREP] = brep
    mesh.metadata[SURFACES], mesh.metadata[FACE_NAMES] = surfaces, names
    return mesh
