"""Variables of the vocabulary in a netCDF file."""

import math
from collections.abc import Sequence
from typing import Any

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.checksums import crc32
from tolcontact.compilation import Program
from tolcontact.discretization import Nominal
from tolcontact.vocabulary import ArchiveVariable

MAX_CHUNK_BYTES = 1 << 22  # bytes: more would not stay in the library's cache
MIN_CHUNK_ROWS = 16
BLOCK_CHUNK = 256


def define(group: netCDF4.Dataset, variable: ArchiveVariable) -> None:
    """Define a variable of numbers, without values."""
    options: dict[str, Any] = {}
    if {terms.REALIZATION, terms.BLOCK} & set(variable.dims):
        # netCDF's own choice, one row per chunk, reads some fifty times slower.
        fixed = [1 if d in (terms.REALIZATION, terms.BLOCK) else max(len(_dimension(group, d)), 1) for d in variable.dims]
        rows = rows_together(np.dtype(variable.kind).itemsize * math.prod(fixed))
        grows = {terms.REALIZATION: rows, terms.BLOCK: BLOCK_CHUNK}
        options["chunksizes"] = [grows.get(d, size) for d, size in zip(variable.dims, fixed, strict=True)]
    created = group.createVariable(variable.name, variable.kind, variable.dims, **options)
    attributes = variable.all_attributes
    if "flag_values" in attributes:
        attributes["flag_values"] = np.array(attributes["flag_values"], dtype=variable.kind)
    created.setncatts(attributes)


def rows_together(width: int) -> int:
    """Return the rows in a chunk of the file, for rows of `width` bytes: a whole block, or fewer if they are too large."""
    rows = terms.BLOCK_ROWS
    while rows > MIN_CHUNK_ROWS and rows * width > MAX_CHUNK_BYTES:
        rows //= 2
    return rows


def _dimension(group: netCDF4.Dataset, name: str) -> netCDF4.Dimension:
    """Return a dimension of the group, or of the groups above it."""
    if name in group.dimensions or group.parent is None:
        return group.dimensions[name]
    return _dimension(group.parent, name)


class Contents:
    """Variables that are defined one after the other, and whose values are written together.

    The library goes through all definitions again before the first value that follows one.
    """

    def __init__(self) -> None:
        self._values: list[tuple[netCDF4.Variable, Any]] = []

    def add(self, group: netCDF4.Dataset, variable: ArchiveVariable, values: Any) -> None:
        """Add a variable with its final values and their checksum, in a group that has the dimensions."""
        if variable.kind is str:
            self._add_text(group, variable, values)
        else:
            self.lay_out(group, variable, values)
        group[variable.name].setncattr(terms.CHECKSUM, np.int64(crc32(variable, values)))

    def lay_out(self, group: netCDF4.Dataset, variable: ArchiveVariable, values: Any) -> None:
        """Add a variable of numbers whose values will be overwritten."""
        define(group, variable)
        if np.size(values):
            self._values.append((group[variable.name], values))

    def _add_text(self, group: netCDF4.Dataset, variable: ArchiveVariable, values: Any) -> None:
        """Add text as characters. The netCDF library crashes if text of variable length is read through two open handles."""
        text = np.char.encode(np.array(values, dtype=str), "utf-8")
        length = group.createDimension(f"{variable.name}_length", max(text.dtype.itemsize, 1))
        created = group.createVariable(variable.name, "S1", (*variable.dims, length.name))
        if text.size:
            letters = text.reshape(*text.shape, 1).view("S1") if text.dtype.itemsize else ""
            self._values.append((created, letters))
        created.setncatts({**variable.all_attributes, "_Encoding": "utf-8"})

    def write(self) -> None:
        """Write all values."""
        for stored, values in self._values:
            stored[...] = values


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
        terms.CONTRIBUTOR: len(nominal.contributors)
    }


def units_of_rows(program: Program) -> dict[ArchiveVariable, str]:
    """Return the units that depend on the model; the units of measures are "1" if they differ."""
    units = {measure.units for measure in program.nominal.measures} or {"mm"}
    return {
        terms.REACTION: program.method.minimizes.reaction_units,
        terms.MEASURED: units.pop() if len(units) == 1 else "1",
    }


def attributes_of(variable: ArchiveVariable, program: Program) -> dict[str, Any]:
    """Return the attributes of a variable of realizations, for a model."""
    attributes = variable.all_attributes
    if "flag_values" in attributes:
        attributes["flag_values"] = np.array(attributes["flag_values"], dtype=variable.kind)
    units = units_of_rows(program)
    return attributes | ({"units": units[variable]} if variable in units else {})
