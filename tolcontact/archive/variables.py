"""Variables of the vocabulary in netCDF files: their definition, and the labels, sizes and values of realizations.

Only one thread may use the netCDF library at a time.
"""

import contextlib
import math
import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import netCDF4
import numpy as np
import pandas as pd
import xarray as xr
from xarray.backends import NetCDF4DataStore

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.compilation import Program
from tolcontact.discretization import Nominal
from tolcontact.errors import ArchiveError
from tolcontact.simulation import Block
from tolcontact.system import files
from tolcontact.vocabulary import ArchiveVariable

CACHE_BYTES = 1 << 20  # a chunk of most variables; with the usual size, all caches would take as much memory as all else
MAX_CHUNK_BYTES = 1 << 22  # bytes: more would not stay in the library's cache
MIN_CHUNK_ROWS = 16
OMITTED = {
    "measures": {*terms.POSES, *terms.STATION_POSES, *terms.ELASTIC_ROWS, terms.DEVIATION},
    "poses": {terms.DEVIATION},
    "all": set(),
}
COPIES = 2  # of each row for a moment: in the journal, and in the archive


with netCDF4.Dataset("in memory", "w", diskless=True) as _file:
    XARRAY_LOCK = NetCDF4DataStore(_file).lock  # type: ignore[no-untyped-call]  # held while xarray uses the library


@contextlib.contextmanager
def open_netcdf(path: Path, mode: Literal["w", "r+", "r"]) -> Iterator[netCDF4.Dataset]:
    """Open a file whose values are read and written as they are, without masks. Meanwhile xarray uses no netCDF file."""
    with XARRAY_LOCK, small_caches(), netCDF4.Dataset(files.plain_path(path), mode, format="NETCDF4") as file:
        file.set_auto_maskandscale(False)
        yield file


@contextlib.contextmanager
def small_caches() -> Iterator[None]:
    """Give each variable of a file that is opened meanwhile a small cache."""
    usual = netCDF4.get_chunk_cache()
    try:
        netCDF4.set_chunk_cache(CACHE_BYTES)
        yield
    finally:
        netCDF4.set_chunk_cache(*usual)


def define(group: netCDF4.Dataset, variable: ArchiveVariable, values: Any = None) -> tuple[netCDF4.Variable, np.ndarray]:
    """Define a variable, and the dimensions of its values that the group does not have; return it, and the values as stored.

    Checksums are compared on reading. A variable of realizations has no values yet.
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
    created.setncatts(_attributes(variable))
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


class Row(NamedTuple):
    """A variable of realizations in the group of that path; empty for the root."""

    group: str
    variable: ArchiveVariable

    @property
    def path(self) -> str:
        """The path of the variable in a file."""
        return f"{self.group}/{self.variable.name}"

    @property
    def label(self) -> str:
        """The name of the variable, with the group if several groups have it."""
        return self.path if self.variable in terms.STATION_ROWS else self.variable.name


def _row(variable: ArchiveVariable) -> Row:
    """Return a variable of realizations that belongs to no station in its group."""
    elastic = dict.fromkeys(terms.ELASTIC_ROWS, terms.ELASTIC_GROUP)
    return Row(({terms.DEVIATION: "sample"} | elastic).get(variable, ""), variable)


def kept_rows(nominal: Nominal, keep: str) -> tuple[Row, ...]:
    """Return the variables that an archive holds for each realization with the option `keep`."""
    rows = [_row(variable) for variable in terms.BY_REALIZATION]
    rows += [Row(terms.station_group(scene.station), variable) for scene in nominal.scenes for variable in terms.STATION_ROWS]
    rows += [_row(variable) for variable in terms.ELASTIC_ROWS if len(nominal.loads)]
    return tuple(row for row in rows if row.variable not in OMITTED[keep])


def row_values(block: Block, labels: Collection[str], nominal: Nominal) -> dict[str, np.ndarray]:
    """Return the values of variables of a block as they are stored, by their labels, in the order of an archive."""
    values = {_row(variable): array for variable, array in block.values().items()}
    for number, scene in enumerate(nominal.scenes):
        poses = block.poses[:, :, [k for k, part in enumerate(nominal.parts) if part.station == scene.station]]
        arrays = pose.translation(poses), pose.rotation(poses), block.station_status[:, number]
        group = terms.station_group(scene.station)
        values |= {Row(group, variable): array for variable, array in zip(terms.STATION_ROWS, arrays, strict=True)}
    if nominal.scenes:
        poses = block.poses[:, :, nominal.last_indices]
        values |= {Row("", terms.ROTATION): pose.rotation(poses), Row("", terms.TRANSLATION): pose.translation(poses)}
        values[Row("", terms.LOCATOR_OFFSET)] = block.locator_offset[:, nominal.last_indices]
    rows = [row for row in kept_rows(nominal, "all") if row.label in labels]
    return {row.label: np.ascontiguousarray(values[row], dtype=row.variable.kind) for row in rows}


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


def check_room(path: Path, nominal: Nominal, rows: Sequence[Row], samples: int) -> None:
    """Raise ArchiveError if the disk has no room for `samples` more realizations of the variables `rows`."""
    needed, free = COPIES * samples * _bytes_of_row(nominal, rows), shutil.disk_usage(path.parent).free
    if needed > free:
        keeps_poses = any(row.variable is terms.ROTATION for row in rows)
        advice = ", or keep less of each realization (measures)" if keeps_poses else ""
        raise ArchiveError(
            f'archive "{path}" needs {size_in_words(needed)} for {samples} realizations, but its disk has '
            f"{size_in_words(free)} free; ask for fewer, write to another disk{advice}"
        )


def bytes_of_rows(nominal: Nominal, keep: str, samples: int) -> int:
    """Return the size of `samples` realizations in an archive with the option `keep` [bytes]."""
    return samples * _bytes_of_row(nominal, kept_rows(nominal, keep))


def _bytes_of_row(nominal: Nominal, rows: Sequence[Row]) -> int:
    sizes = {terms.REALIZATION: 1, **sizes_of_rows(nominal)}
    stations = {terms.station_group(scene.station): {terms.STATION_PART: len(scene.assembly.parts)} for scene in nominal.scenes}
    return sum(
        np.dtype(row.variable.kind).itemsize
        * math.prod((sizes | stations.get(row.group, {}))[dim] for dim in row.variable.dims)
        for row in (Row("", terms.NUMBERS), *rows)
    )


def size_in_words(count: float) -> str:
    """Return a number of bytes with a readable unit: 1.5 GB."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


def units_of_rows(program: Program) -> dict[ArchiveVariable, str]:
    """Return the units that depend on the model; the units of measures are "1" if they differ."""
    units = {measure.units for measure in program.nominal.measures} or {"mm"}
    return {
        terms.REACTION: program.method.minimizes.reaction_units,
        terms.MEASURED: units.pop() if len(units) == 1 else "1",
    }


def _attributes(variable: ArchiveVariable) -> dict[str, Any]:
    attributes = variable.all_attributes
    if "flag_values" in attributes:
        attributes["flag_values"] = np.array(attributes["flag_values"], dtype=variable.kind)
    return attributes


def labelled(program: Program, values: Mapping[ArchiveVariable, Any], attributes: Mapping[str, Any]) -> xr.Dataset:
    """Return arrays of any kind as variables of realizations, with the labels and attributes of an archive."""
    texts = {**labels_of_rows(program.nominal), terms.CONTRIBUTOR: program.nominal.contributors}
    labels: dict[str, Any] = {name: np.array(list(names), dtype=object) for name, names in texts.items()}  # text of any length
    labels[terms.REALIZATION] = pd.RangeIndex(len(values[terms.STATUS]))
    units = {variable: {"units": text} for variable, text in units_of_rows(program).items()}
    return xr.Dataset(
        {
            variable.name: (variable.dims, array, _attributes(variable) | units.get(variable, {}))
            for variable, array in values.items()
        },
        {label.name: label.entry(labels[label.name]) for label in (*terms.COORDINATES, terms.CONTRIBUTOR_LABEL)},
        attributes,
    )
