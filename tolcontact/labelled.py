"""Tables of arrays with labelled dimensions, on NumPy alone: what summaries read and return.

Importing xarray takes longer than a small run with its summary. So a command that needs no more reads an archive as a `Group`
of `Table`s. These have the names and the meaning of xarray's: a function that takes a table takes an `xarray.Dataset`, too.
"""

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, Union

import numpy as np

if TYPE_CHECKING:
    import xarray

Index = int | range | list[int]  # of one dimension


class Source(Protocol):
    """What holds the values of a column: an array, or a variable of a file, of which only what is asked for is read."""

    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def dtype(self) -> np.dtype: ...
    def __getitem__(self, key: tuple[int | slice, ...]) -> Any: ...


class Column:
    """An array with named dimensions. Its values are read when they are asked for."""

    def __init__(
        self,
        dims: Sequence[Hashable],
        source: Source,
        attrs: Mapping[str, Any],
        labels: Mapping[str, "Column"],
        indices: tuple[Index, ...] | None = None,
    ) -> None:
        """Take the dimensions of the source, the labels of some of them, and which entries along each the column has."""
        self._dims, self._source, self._labels = tuple(map(str, dims)), source, labels
        self.attrs = dict(attrs)
        self._indices = tuple(map(range, source.shape)) if indices is None else indices

    @property
    def dims(self) -> tuple[str, ...]:
        """The names of the dimensions."""
        return tuple(dim for dim, index in zip(self._dims, self._indices, strict=True) if not isinstance(index, int))

    @property
    def shape(self) -> tuple[int, ...]:
        """The sizes of the dimensions."""
        return tuple(len(index) for index in self._indices if not isinstance(index, int))

    @property
    def dtype(self) -> np.dtype:
        """The type of the values."""
        return self._source.dtype

    @property
    def size(self) -> int:
        """The number of values."""
        return math.prod(self.shape)

    @property
    def values(self) -> np.ndarray:
        """The values, as an array."""
        keys = tuple(slice(None) if isinstance(index, list) else _key(index) for index in self._indices)
        values, axis = np.asarray(self._source[keys]), 0
        for index in self._indices:
            if isinstance(index, list):
                values = values.take(index, axis)
            axis += not isinstance(index, int)
        return values

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, rows: slice) -> "Column":
        return self.isel({self.dims[0]: rows})

    def __float__(self) -> float:
        return float(self.values)

    def __int__(self) -> int:
        return int(self.values)

    def isel(self, places: Mapping[str, int | slice | Sequence[int]]) -> "Column":
        """Return the entries at some places along dimensions."""
        indices = tuple(
            _taken(index, places[dim]) if dim in places and not isinstance(index, int) else index
            for dim, index in zip(self._dims, self._indices, strict=True)
        )
        return Column(self._dims, self._source, self.attrs, self._labels, indices)

    def sel(self, labels: Mapping[str, Any] | None = None, **named: Any) -> "Column":
        """Return the entries with some labels along dimensions."""
        return self.isel(_places(self._labels, {**(labels or {}), **named}))

    def transpose(self, *dims: Any) -> "Column":
        """Return the array with its dimensions in another order; an ellipsis stands for all others."""
        unnamed = [dim for dim in self.dims if dim not in dims]
        order = [name for dim in dims for name in (unnamed if dim is ... else [dim])]
        values = self.values.transpose([self.dims.index(dim) for dim in order])
        return Column(order, values, self.attrs, self._labels)


class Table:
    """Columns by name, of which some are coordinates: labels of a dimension, or what describes its entries."""

    def __init__(
        self, columns: Mapping[str, Any], coords: Mapping[str, Any] | None = None, attrs: Mapping[str, Any] | None = None
    ) -> None:
        """Take columns as xarray.Dataset does: (dimensions, values, attributes), or values alone of their own dimension."""
        self.attrs = dict(attrs or {})
        self._columns: dict[str, Column] = {}
        self.coords: dict[str, Column] = {}
        for name, entry in (coords or {}).items():
            self.coords[name] = self._columns[name] = _column(name, entry, self.coords)
        for name, entry in columns.items():
            self._columns[name] = _column(name, entry, self.coords)

    @property
    def sizes(self) -> dict[str, int]:
        """The sizes of all dimensions."""
        return {dim: size for column in self._columns.values() for dim, size in zip(column.dims, column.shape, strict=True)}

    @property
    def data_vars(self) -> dict[str, Column]:
        """The columns that are no coordinates."""
        return {name: column for name, column in self._columns.items() if name not in self.coords}

    def __contains__(self, name: str) -> bool:
        return name in self._columns

    def __getitem__(self, name: Any) -> Any:
        """Return a column, or a table of the columns in a list, with all coordinates."""
        if isinstance(name, list):
            return self._with({entry: self._columns[entry] for entry in name})
        return self._columns[name]

    def isel(self, places: Mapping[str, Any]) -> "Table":
        """Return the entries at some places along dimensions, of all columns that have them."""
        return self._with(self.data_vars, places)

    def sel(self, labels: Mapping[str, Any] | None = None, **named: Any) -> "Table":
        """Return the entries with some labels along dimensions, of all columns that have them."""
        return self.isel(_places(self.coords, {**(labels or {}), **named}))

    def _with(self, columns: Mapping[str, Column], places: Mapping[str, Any] | None = None) -> "Table":
        coords = {name: column.isel(places or {}) for name, column in self.coords.items()}
        return Table({name: column.isel(places or {}) for name, column in columns.items()}, coords, self.attrs)


class Group:
    """A table with groups below it, by name, as a netCDF file has them; groups share the coordinates of those above."""

    def __init__(self, path: str, table: Table, children: Mapping[str, "Group"]) -> None:
        self.path, self._table, self.children = path, table, children

    @property
    def attrs(self) -> dict[str, Any]:
        """The attributes of the table."""
        return self._table.attrs

    @property
    def sizes(self) -> dict[str, int]:
        """The sizes of the dimensions of the table."""
        return self._table.sizes

    def to_dataset(self) -> Table:
        """Return the table of this group alone."""
        return self._table

    def __getitem__(self, path: str) -> "Group":
        name, _, tail = path.strip("/").partition("/")
        return self.children[name][tail] if tail else self.children[name]


def _column(name: str, entry: Any, labels: Mapping[str, Column]) -> Column:
    if isinstance(entry, Column):
        return Column(entry._dims, entry._source, entry.attrs, labels, entry._indices)
    dims, values, attrs = (*entry, {})[:3] if isinstance(entry, tuple) else ((name,), entry, {})
    source = values if hasattr(values, "shape") else np.asarray(values)
    return Column((dims,) if isinstance(dims, str) else dims, source, attrs, labels)


def _places(columns: Mapping[str, Column], labels: Mapping[str, Any]) -> dict[str, Any]:
    """Return the places of labels along dimensions. Raises ValueError for a label that is not there."""
    places = {}
    for dim, label in labels.items():
        names = columns[dim].values.tolist()
        places[dim] = [names.index(name) for name in label] if isinstance(label, list) else names.index(label)
    return places


def _taken(index: range | list[int], place: Any) -> Index:
    """Return what a place among the entries of an index is among those of the source."""
    if isinstance(place, list):
        return [index[k] for k in place]
    return index[place]


def _key(index: int | range) -> int | slice:
    if isinstance(index, int):
        return index
    return slice(index.start, index.stop, index.step)


# Documentation resolves these names wherever they are used: they are classes, or begin with a module.
Rows = Union[Table, "xarray.Dataset"]
Results = Union[Group, "xarray.DataTree"]
RowsOf = TypeVar("RowsOf", Table, "xarray.Dataset", "Table | xarray.Dataset")
