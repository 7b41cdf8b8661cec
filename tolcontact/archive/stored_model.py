"""The model and the method of a run, rebuilt from its archive."""

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.declaration import Assembly
from tolcontact.declaration.document import from_document
from tolcontact.errors import ArchiveError
from tolcontact.geometry import surfaces_of, with_known_surfaces
from tolcontact.method import Method
from tolcontact.realizations import declaration_of


def model_of(results: xr.DataTree) -> Assembly:
    """Return the declared assembly, rebuilt from the `results` of a run: `tc.io.model_of(tc.open_archive("run.nc"))`."""
    try:
        document = declaration_of(results)
    except (KeyError, ValueError, RecursionError) as error:
        raise ArchiveError(f"the declared model in the archive is damaged: {error}") from error
    meshes = {}
    if "mesh" in results["model"].children:
        for group in results["model/mesh"].children.values():
            mesh = group.to_dataset()
            meshes[str(mesh.attrs["part"])] = _mesh(mesh)
    return from_document(document, meshes)


def method_of_run(results: xr.DataTree) -> Method:
    """Return the method of a run."""
    choices: dict[str, Any] = {field.name: str(results.attrs[field.name]) for field in fields(Method)}
    return Method(**choices)


def _mesh(mesh: xr.Dataset) -> Any:
    """Return the mesh of a part, with the surfaces of its B-rep faces if there are any."""
    vertices, faces = mesh[terms.MESH_VERTICES.name].values, mesh[terms.MESH_FACES.name].values
    if any(variable.name not in mesh for variable in terms.KNOWN_SURFACES):
        stated = mesh.get(terms.COORDINATE_SPACING.name)
        return SimpleNamespace(
            vertices=vertices, faces=faces, coordinate_spacing=np.zeros(3) if stated is None else stated.values
        )
    brep = mesh[terms.BREP_OF_FACE.name].values
    arrays = {name: mesh[variable.name].values for name, variable in terms.OF_BREP_FACE.items()}
    kinds, names = arrays["kind"], mesh.get(terms.NAME_OF_BREP_FACE.name, ())
    sound = all(np.isfinite(values).all() for values in arrays.values())
    sound = sound and bool(np.isin(kinds, range(-1, len(terms.SURFACE_KINDS))).all())
    if not sound or (len(brep) and not 0 <= brep.min() <= brep.max() < len(kinds)):
        raise ArchiveError("the surfaces of a mesh in the archive are damaged")
    return with_known_surfaces(vertices, faces, brep, surfaces_of(arrays), tuple(str(name) for name in np.asarray(names)))
