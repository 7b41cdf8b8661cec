"""An archive is read with xarray, and holds its model."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from tolcontact import vocabulary as words
from tolcontact.assembly import Assembly
from tolcontact.assembly.document import from_document
from tolcontact.errors import ArchiveError


def open_archive(path: str | Path, *, shown: Path | None = None) -> xr.DataTree:
    """An archive as a tree of labelled datasets, read on demand.

    Raises ArchiveError where the file is missing, is not netCDF, or was not written by tolcontact; messages speak of
    `shown` where that is given.
    """
    source, path = Path(path), shown or Path(path)
    if not source.is_file():
        raise ArchiveError(f'archive "{path}" does not exist; write one with: tolcontact run MODEL.py --out {path}')
    try:
        # Numbers of realizations are not read, which takes as much memory as all else together: they are 0, 1, 2, ...
        tree = xr.open_datatree(source, engine="netcdf4", drop_variables=words.REALIZATION)
    except (OSError, ValueError) as error:
        raise ArchiveError(f'"{path}" cannot be read as netCDF: {error}') from error
    optional = (*words.POSES, *words.ADDED)
    missing = [v.name for v in words.ROWS if v not in optional and v.name not in tree.ds] + [
        g for g in ("model", "contact", "sample", "field") if g not in tree.children
    ]
    if missing:
        tree.close()
        raise ArchiveError(f'"{path}" is not an archive of tolcontact: it has no {", ".join(missing)}')
    numbers = pd.RangeIndex(tree.sizes[words.REALIZATION])
    tree.coords[words.REALIZATION] = (words.REALIZATION, numbers, words.NUMBERS.all_attributes)
    return tree


def model_of(results: xr.DataTree) -> Assembly:
    """The declared assembly, rebuilt from an archive."""
    document = json.loads(str(results["model"][words.DECLARATION.name].values))
    meshes = {}
    if "mesh" in results["model"].children:
        for name, group in results["model/mesh"].children.items():
            triangles = group.to_dataset()
            meshes[name] = _Triangles(triangles[words.MESH_VERTICES.name].values, triangles[words.MESH_FACES.name].values)
    return from_document(document, meshes)


class _Triangles:
    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self.vertices, self.faces = vertices, faces
