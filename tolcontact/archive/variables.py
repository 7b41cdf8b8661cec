"""Variables of the vocabulary in netCDF files: their definition, and the labels, sizes and units of realizations."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import netCDF4
import numpy as np
import pandas as pd
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.compilation import Program
from tolcontact.discretization import Nominal
from tolcontact.vocabulary import ArchiveVariable

MAX_CHUNK_BYTES = 1 << 22  # bytes: more would not stay in the library's cache
MIN_CHUNK_ROWS = 16


def define(
    group: netCDF4.Dataset, variable: ArchiveVariable, values: Any = None, *, units: Mapping[ArchiveVariable, str]
) -> tuple[netCDF4.Variable, np.ndarray]:
    """Define a variable, and the dimensions of its values that the group does not have; return it, and the values as stored.

    Checksums are compared on reading. A variable of realizations has no values yet. `units` are those of `units_of_model`.
    """
    if variable.kind is str:
        # The netCDF library crashes if text of variable length is read through two open handles: it is stored as characters.
        text = np.char.encode(np.array(values, dtype=str), "utf-8")
        _create_dimensions(group, variable, text.shape)
        length = group.createDimension(f"{variable.name}_length", max(text.dtype.itemsize, 1))
        created = group.createVariable(variable.name, "S1", (*variable.dims, length.name), fletcher32=True)
        created.setncatts({**variable.all_attributes, "_Encoding": "utf-8"})
        created.set_auto_chartostring(False)
        return created, text.reshape(*text.shape, 1).view("S1") if text.dtype.itemsize else np.zeros(0)
    array = np.zeros(0) if values is None else np.asarray(values)
    options: dict[str, Any] = {"fletcher32": True}
    _create_dimensions(group, variable, () if values is None else array.shape)
    if terms.REALIZATION in variable.dims:
        dimensions = _dimensions(group)
        # netCDF's own choice, one row per chunk, reads some fifty times slower.
        fixed = [max(len(dimensions[dim]), 1) for dim in variable.dims[1:]]
        options["chunksizes"] = [_chunk_rows(np.dtype(variable.kind).itemsize * math.prod(fixed)), *fixed]
    created = group.createVariable(variable.name, variable.kind, variable.dims, **options)
    created.setncatts(_attributes(variable, units))
    return created, array


def _chunk_rows(width: int) -> int:
    """Return the rows in a chunk of the file, for rows of `width` bytes: a whole block, or fewer if they are too large."""
    rows = terms.BLOCK_ROWS
    while rows > MIN_CHUNK_ROWS and rows * width > MAX_CHUNK_BYTES:
        rows //= 2
    return rows


def _dimensions(group: netCDF4.Dataset) -> dict[str, netCDF4.Dimension]:
    """Return the dimensions of a group and of the groups above it by name."""
    above = {} if group.parent is None else _dimensions(group.parent)
    return above | group.dimensions


def _create_dimensions(group: netCDF4.Dataset, variable: ArchiveVariable, shape: Sequence[int]) -> None:
    known = _dimensions(group)
    for name, size in zip(variable.dims, shape, strict=False):
        if name not in known:
            group.createDimension(name, size)


def overwrite(file: netCDF4.Dataset, group: str, values: Mapping[ArchiveVariable, Any]) -> None:
    """Overwrite the values of variables in the group of that path."""
    for variable, array in values.items():
        if np.size(array):
            file[f"{group}/{variable.name}"][...] = array


def labels_of_rows(nominal: Nominal) -> dict[str, Sequence[str]]:
    """Return the labels along the dimensions of rows."""
    return {
        terms.STATE: terms.STATES,
        terms.PART: [part.name for part in nominal.last_parts],
        terms.PAIR: [pair.name for pair in nominal.pairs],
        terms.MEASURE: [measure.name for measure in nominal.measures],
        terms.AXIS: terms.AXES,
        terms.BODY_AXIS: terms.AXES,
    }


def sizes_of_rows(nominal: Nominal) -> dict[str, int]:
    """Return the sizes of the dimensions of a row."""
    return {name: len(labels) for name, labels in labels_of_rows(nominal).items()} | {
        terms.CONTRIBUTOR: len(nominal.contributors),
        terms.LOADS: len(nominal.loads),
        terms.WELD_ROWS: nominal.input_count - len(nominal.contributors),
    }


def units_of_model(program: Program) -> dict[ArchiveVariable, str]:
    """Return the units that depend on the model; those of measures, or of contributors, are "1" if they differ."""
    units = {terms.REACTION: program.method.minimizes.reaction_units}
    for variables, labelled_things in (
        (terms.IN_MEASURE_UNITS, program.nominal.measures),
        (terms.IN_CONTRIBUTOR_UNITS, program.draws.contributors),
    ):
        stated = {thing.units for thing in labelled_things} or {"mm"}
        units |= dict.fromkeys(variables, stated.pop() if len(stated) == 1 else "1")
    return units


def _attributes(variable: ArchiveVariable, units: Mapping[ArchiveVariable, str]) -> dict[str, Any]:
    attributes = variable.all_attributes | ({"units": units[variable]} if variable in units else {})
    if "flag_values" in attributes:
        attributes["flag_values"] = np.array(attributes["flag_values"], dtype=variable.kind)
    return attributes


def labelled(program: Program, values: Mapping[ArchiveVariable, Any], attributes: Mapping[str, Any]) -> xr.Dataset:
    """Return arrays of any kind as variables of realizations, with the labels and attributes of an archive."""
    texts = {**labels_of_rows(program.nominal), terms.CONTRIBUTOR: program.nominal.contributors}
    labels: dict[str, Any] = {name: np.array(list(names), dtype=object) for name, names in texts.items()}  # text of any length
    labels[terms.REALIZATION] = pd.RangeIndex(len(values[terms.STATUS]))
    units = units_of_model(program)
    return xr.Dataset(
        {variable.name: (variable.dims, array, _attributes(variable, units)) for variable, array in values.items()},
        {label.name: label.entry(labels[label.name]) for label in (*terms.COORDINATES, terms.CONTRIBUTOR_LABEL)},
        attributes,
    )
