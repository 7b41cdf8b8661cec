"""Reading an archive with xarray, and rebuilding its model."""

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.archive.file_tables import library_errors
from tolcontact.archive.inspection import check_archive
from tolcontact.declaration import Assembly
from tolcontact.declaration.document import from_document
from tolcontact.declaration.feature_tolerance import KINDS
from tolcontact.errors import ArchiveError
from tolcontact.geometry import surfaces_of, with_known_surfaces
from tolcontact.method import Method

FIRST_WITH_FORM = 5  # the first format of archives with faces that are not flat
FIRST_WITH_SPRINGS = 7  # and with locators that give way
FORM_KINDS = [kind for kind, tolerance in KINDS.items() if tolerance.is_form]


def open_archive(path: str | Path) -> xr.DataTree:
    """Return an archive as a tree of labelled datasets that are read on demand.

    Raises ArchiveError if the file is missing, is not an archive of tolcontact, or is damaged: all but the realizations is
    read and compared with its checksums; `summarize` checks those of the realizations.
    """
    path = Path(path)
    check_archive(path)
    return open_unchecked(path)


def open_unchecked(path: Path) -> xr.DataTree:
    """Open an archive that is known to be undamaged."""
    with library_errors(path):
        # Numbers of realizations are not read, which takes as much memory as all else together: they are 0, 1, 2, ...
        tree = xr.open_datatree(path, engine="netcdf4", drop_variables=terms.REALIZATION)
    numbers = pd.RangeIndex(tree.sizes[terms.REALIZATION])
    tree.coords[terms.REALIZATION] = (terms.REALIZATION, numbers, terms.NUMBERS.all_attributes)
    return tree


def model_of(results: xr.DataTree) -> Assembly:
    """Return the declared assembly, rebuilt from an archive."""
    try:
        document = json.loads(str(results["model"][terms.DECLARATION.name].values))
    except (KeyError, ValueError, RecursionError) as error:
        raise ArchiveError(f"the declared model in the archive is damaged: {error}") from error
    number = int(results.attrs.get("format", 1))
    if number < FIRST_WITH_FORM:
        _state_form_alone(document)
    if number < FIRST_WITH_SPRINGS:
        _leave_locators_rigid(document, presses=method_of_run(results).minimizes.presses)
    meshes = {}
    if "mesh" in results["model"].children:
        for name, group in results["model/mesh"].children.items():
            mesh = group.to_dataset()
            # Groups of format 1 do not say the part's name: it was their own.
            meshes[str(mesh.attrs.get("part", name))] = _mesh(mesh)
    return from_document(document, meshes)


def _state_form_alone(document: Any) -> None:
    """Let tolerances of form in a document leave the shape of features as it is: formats before form drew none."""
    try:
        tolerances = [
            tolerance
            for part in document["parts"]
            for feature in part.get("features", ())
            for tolerance in feature["tolerances"]
        ]
        for tolerance in tolerances:
            if tolerance["kind"] in FORM_KINDS:
                tolerance.setdefault("form", None)
    except (KeyError, TypeError, AttributeError):  # the reading of the document finds what is wrong with it
        return


def _leave_locators_rigid(document: Any, *, presses: bool) -> None:
    """Leave out stiffnesses in a document that had no effect: formats before springs let no locator give way to forces."""
    try:
        schemes = [location["scheme"] for location in document["locations"]]
        for locator in [locator for scheme in schemes if isinstance(scheme, list) for locator in scheme]:
            if not locator.get("springy") and (locator["one_sided"] or presses):
                locator.pop("stiffness", None)
    except (KeyError, TypeError, AttributeError):  # the reading of the document finds what is wrong with it
        return


def method_of_run(results: xr.DataTree) -> Method:
    """Return the method of a run; choices that an earlier format does not state are the usual ones."""
    choices: dict[str, Any] = {field.name: results.attrs[field.name] for field in fields(Method) if field.name in results.attrs}
    return Method(**{name: value if isinstance(value, str) else float(value) for name, value in choices.items()})  # type: ignore[arg-type]


class _Triangles:
    def __init__(self, vertices: np.ndarray, faces: np.ndarray, coordinate_spacing: np.ndarray) -> None:
        self.vertices, self.faces, self.coordinate_spacing = vertices, faces, coordinate_spacing


def _mesh(mesh: xr.Dataset) -> Any:
    """Return the mesh of a part, with the surfaces of its B-rep faces if there are any."""
    vertices, faces = mesh[terms.MESH_VERTICES.name].values, mesh[terms.MESH_FACES.name].values
    if any(variable.name not in mesh for variable in terms.KNOWN_SURFACES):
        stated = terms.COORDINATE_SPACING.name
        return _Triangles(vertices, faces, mesh[stated].values if stated in mesh else np.zeros(3))
    brep = mesh[terms.BREP_OF_FACE.name].values
    arrays = {name: mesh[variable.name].values for name, variable in terms.OF_BREP_FACE.items()}
    kinds = arrays["kind"]
    sound = all(np.isfinite(values).all() for values in arrays.values())
    sound = sound and bool((kinds >= -1).all()) and bool((kinds < len(terms.SURFACE_KINDS)).all())
    if not sound or (len(brep) and not 0 <= brep.min() <= brep.max() < len(kinds)):
        raise ArchiveError("the surfaces of a mesh in the archive are damaged")
    named = terms.NAME_OF_BREP_FACE.name
    names = tuple(map(str, mesh[named].values)) if named in mesh else ()
    return with_known_surfaces(vertices, faces, brep, surfaces_of(arrays), names)
