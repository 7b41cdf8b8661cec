"""Which triangles of a face stand for surfaces that are known exactly: a file states them, or they are fitted to vertices."""

import numpy as np
import trimesh

from tolcontact.discretization.analytic import Form
from tolcontact.discretization.brep_face import FIT
from tolcontact.discretization.edges import smooth_pieces
from tolcontact.discretization.fitting import fitted
from tolcontact.discretization.shape_files import BREP, SURFACES

FACETS = 5  # directions of facets at least, from which a round surface is told from a fold
SAME = 1e-9  # normals that differ by less are one direction


def known_forms(mesh: trimesh.Trimesh, chosen: np.ndarray) -> tuple[list[Form], np.ndarray]:
    """Surfaces, and for each of the `chosen` triangles (face,) of a mesh the number of the one that it stands for; -1 if none.

    Of a STEP file they are those of its B-rep faces; what it does not state, and smooth pieces of other meshes, are fitted.
    Planes are not fitted: flat triangles are exact.
    """
    forms: list[Form] = []
    form_of = np.full(len(chosen), -1)
    brep = mesh.face_attributes.get(BREP)
    group = smooth_pieces(mesh, chosen) if brep is None else np.asarray(brep).ravel()[chosen]
    for number in np.unique(group):
        own = np.flatnonzero(group == number)
        form = (None if brep is None else mesh.metadata[SURFACES][number]) or _fitted(mesh, chosen[own])
        if form is not None:
            form_of[own] = len(forms)
            forms.append(form)
    return forms, form_of


def _fitted(mesh: trimesh.Trimesh, own: np.ndarray) -> Form | None:
    normals = np.asarray(mesh.face_normals)[own]
    if len(np.unique(np.round(normals / SAME), axis=0)) < FACETS:
        return None
    form = fitted(np.asarray(mesh.triangles)[own], FIT)
    return None if form is None or form.kind == "plane" else form


def known_surfaces(mesh: trimesh.Trimesh) -> tuple[np.ndarray, list[Form | None]] | None:
    """Of a mesh from a STEP file the B-rep face of each triangle (face,), from 0, and their surfaces; else None."""
    brep = mesh.face_attributes.get(BREP)
    return None if brep is None else (np.asarray(brep).ravel(), mesh.metadata[SURFACES])


def with_known_surfaces(
    vertices: np.ndarray, faces: np.ndarray, brep: np.ndarray, surfaces: list[Form | None]
) -> trimesh.Trimesh:
    """A mesh that knows them again."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.face_attributes[BREP] = brep
    mesh.metadata[SURFACES] = surfaces
    return mesh
