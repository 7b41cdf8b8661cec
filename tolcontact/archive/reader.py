"""Reading an archive with xarray, checking its realizations, and rebuilding its model."""

import contextlib
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.archive.inspection import check_archive
from tolcontact.archive.variables import small_caches
from tolcontact.declaration import Assembly
from tolcontact.declaration.document import from_document
from tolcontact.errors import ArchiveError, OptionError
from tolcontact.geometry import surfaces_of, with_known_surfaces
from tolcontact.method import Method
from tolcontact.realizations import declaration_of
from tolcontact.system import files

PIECE_BYTES = 1 << 22  # of a variable that are read at once


def open_archive(path: str | Path) -> xr.DataTree:
    """Return the archive at a `path` as a tree of labelled datasets that are read on demand: `tc.open_archive("run.nc")`.

    Raises ArchiveError if the file is missing, is not an archive of tolcontact, or is damaged: all but the realizations is
    read and compared with its checksums; `summarize` checks the realizations.
    """
    path = Path(path)
    check_archive(path)
    return open_unchecked(path)


def open_unchecked(path: Path) -> xr.DataTree:
    """Open an archive that is known to be undamaged."""
    try:
        with small_caches():
            # Numbers of realizations are not read, which takes as much memory as all else together: they are 0, 1, 2, ...
            plain = files.plain_path(path)
            tree = xr.open_datatree(plain, engine="netcdf4", drop_variables=terms.REALIZATION, decode_times=False)
    except Exception as error:  # libraries may find a fault that the inspection did not
        raise ArchiveError(f'"{path}" cannot be read: {type(error).__name__}: {error}') from error
    numbers = pd.RangeIndex(tree.sizes[terms.REALIZATION])
    tree.coords[terms.REALIZATION] = (terms.REALIZATION, numbers, terms.NUMBERS.all_attributes)
    return tree


@contextlib.contextmanager
def opened(results: xr.DataTree | str | Path) -> Iterator[xr.DataTree]:
    """Open results as a tree; close them afterwards if they are given as the path of an archive."""
    if isinstance(results, str | Path):
        with open_archive(results) as tree:
            yield tree
    elif isinstance(results, xr.DataTree):
        yield results
    else:
        raise OptionError(
            f"results are a {type(results).__name__}; expected what tc.run or tc.open_archive returns, or an archive's path"
        )


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


def check_rows(results: xr.DataTree) -> None:
    """Raise ArchiveError if realizations are not what was written: the library compares the checksums of what it reads."""
    for group in results.subtree:
        for name, values in group.to_dataset(inherit=False).data_vars.items():
            if terms.REALIZATION in values.dims:
                _check_variable(str(name), values)


def _check_variable(name: str, values: xr.DataArray) -> None:
    row_bytes = values.dtype.itemsize * max(values.size // max(len(values), 1), 1)
    step = max(PIECE_BYTES // row_bytes // terms.BLOCK_ROWS, 1) * terms.BLOCK_ROWS
    for start in range(0, len(values), step):
        try:
            values[start : start + step].load()
        except (OSError, RuntimeError) as error:
            raise ArchiveError(
                f'the archive is damaged: "{name}" of realizations {start} to {min(start + step, len(values)) - 1} '
                f"is not what was written ({error}); run it again"
            ) from error
