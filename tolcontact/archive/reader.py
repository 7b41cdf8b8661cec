"""An archive is read with xarray, and holds its model."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from tolcontact import vocabulary as words
from tolcontact.archive.inspection import inspect
from tolcontact.declaration import Assembly
from tolcontact.declaration.rebuilding import from_document
from tolcontact.errors import ArchiveError


def open_archive(path: str | Path) -> xr.DataTree:
    """An archive as a tree of labelled datasets, read on demand.

    Raises ArchiveError if the file is missing, is not an archive of tolcontact, or is damaged: all but the realizations is
    read and compared with its checksums; those of the realizations are looked at by `summarize`.
    """
    path = Path(path)
    if not path.is_file():
        raise ArchiveError(f'archive "{path}" does not exist; write one with: tolcontact run MODEL.py --out {path}')
    inspect(path)
    return opened(path)


def opened(path: Path) -> xr.DataTree:
    """An archive that is known to be whole."""
    try:
        # Numbers of realizations are not read, which takes as much memory as all else together: they are 0, 1, 2, ...
        tree = xr.open_datatree(path, engine="netcdf4", drop_variables=words.REALIZATION)
    except Exception as error:  # whatever a library finds that the inspection did not
        raise ArchiveError(f'"{path}" cannot be read: {type(error).__name__}: {error}') from error
    numbers = pd.RangeIndex(tree.sizes[words.REALIZATION])
    tree.coords[words.REALIZATION] = (words.REALIZATION, numbers, words.NUMBERS.all_attributes)
    return tree


def model_of(results: xr.DataTree) -> Assembly:
    """The declared assembly, rebuilt from an archive."""
    try:
        document = json.loads(str(results["model"][words.DECLARATION.name].values))
    except (KeyError, ValueError, RecursionError) as error:
        raise ArchiveError(f"the declared model in the archive is damaged: {error}") from error
    meshes = {}
    if "mesh" in results["model"].children:
        for name, group in results["model/mesh"].children.items():
            of = group.to_dataset()
            # Groups of format 1 do not say the part's name: it was their own.
            triangles = _Triangles(of[words.MESH_VERTICES.name].values, of[words.MESH_FACES.name].values)
            meshes[str(of.attrs.get("part", name))] = triangles
    return from_document(document, meshes)


class _Triangles:
    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self.vertices, self.faces = vertices, faces
