"""Variables of the vocabulary in a netCDF file."""

from typing import Any

import netCDF4
import numpy as np

from tolcontact import vocabulary as words
from tolcontact.vocabulary import Variable

ROW_CHUNK = 1000


def define(group: netCDF4.Dataset, variable: Variable) -> None:
    """A variable of numbers, without values yet."""
    options: dict[str, Any] = {}
    if words.REALIZATION in variable.dims:
        # netCDF's own choice, one row per chunk, reads some fifty times slower.
        sizes = [len(_dimension(group, d)) for d in variable.dims if d != words.REALIZATION]
        options["chunksizes"] = [ROW_CHUNK, *(max(size, 1) for size in sizes)]
    created = group.createVariable(variable.name, variable.kind, variable.dims, **options)
    attributes = variable.all_attributes
    if "flag_values" in attributes:
        attributes["flag_values"] = np.array(attributes["flag_values"], dtype=variable.kind)
    created.setncatts(attributes)


def _dimension(group: netCDF4.Dataset, name: str) -> netCDF4.Dimension:
    """A dimension of the group, or of the groups above it."""
    if name in group.dimensions or group.parent is None:
        return group.dimensions[name]
    return _dimension(group.parent, name)


def write(group: netCDF4.Dataset, variable: Variable, values: Any) -> None:
    """A variable with its values, in a group that has the dimensions."""
    if variable.kind is str:
        _write_text(group, variable, values)
        return
    define(group, variable)
    if np.size(values):
        group[variable.name][...] = values


def _write_text(group: netCDF4.Dataset, variable: Variable, values: Any) -> None:
    """Text as characters. The netCDF library crashes where text of variable length is read through two open handles."""
    text = np.char.encode(np.array(values, dtype=str), "utf-8")
    length = group.createDimension(f"{variable.name}_length", max(text.dtype.itemsize, 1))
    created = group.createVariable(variable.name, "S1", (*variable.dims, length.name))
    if text.size:
        created[...] = text.reshape(*text.shape, 1).view("S1") if text.dtype.itemsize else ""
    created.setncatts({**variable.all_attributes, "_Encoding": "utf-8"})
