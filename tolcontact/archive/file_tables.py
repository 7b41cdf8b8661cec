"""Reading an archive as tables, without xarray: for summaries of commands, and for what a run reads of its own archive."""

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive.inspection import check_archive
from tolcontact.archive.netcdf_library import library_lock, small_caches
from tolcontact.errors import ArchiveError
from tolcontact.labelled import Group, Table


@contextlib.contextmanager
def library_errors(path: Path) -> Iterator[None]:
    """Raise errors of libraries that open an archive as ArchiveError, and give its variables small caches."""
    try:
        with small_caches():
            yield
    except Exception as error:  # libraries may find a fault that the inspection did not
        raise ArchiveError(f'"{path}" cannot be read: {type(error).__name__}: {error}') from error


@contextlib.contextmanager
def open_tables(path: Path) -> Iterator[Group]:
    """Open an archive as tables that are read on demand. Raises ArchiveError as `open_archive` does."""
    check_archive(path)
    with open_tables_unchecked(path) as tables:
        yield tables


@contextlib.contextmanager
def open_tables_unchecked(path: Path) -> Iterator[Group]:
    """Open an archive that is known to be undamaged, as tables that are read on demand."""
    with library_lock():
        with library_errors(path):
            file = netCDF4.Dataset(path)
            file.set_auto_maskandscale(False)
            tables = _group(file, {})
        with file:
            yield tables


def _group(file: netCDF4.Dataset, inherited: Mapping[str, Any]) -> Group:
    columns = {name: _entry(variable) for name, variable in file.variables.items() if name != terms.REALIZATION}
    coords = {**inherited, **{name: entry for name, entry in columns.items() if entry[0] == (name,)}}
    table = Table({name: entry for name, entry in columns.items() if name not in coords}, coords, file.__dict__)
    children = {name: _group(child, table.coords) for name, child in file.groups.items()}
    return Group(file.path, table, children)


def _entry(variable: netCDF4.Variable) -> tuple[tuple[str, ...], Any, dict[str, Any]]:
    """Return the dimensions, the values and the attributes of a variable; texts are read at once."""
    if variable.dtype is str:
        return variable.dimensions, np.asarray(variable[...], dtype=object), variable.__dict__
    if variable.dtype.kind == "S":
        return variable.dimensions[:-1], _texts(variable), variable.__dict__
    return variable.dimensions, variable, variable.__dict__


def _texts(variable: netCDF4.Variable) -> np.ndarray:
    """Return the texts (...) of a variable of letters (..., length)."""
    variable.set_auto_chartostring(False)
    letters, encoding = np.ascontiguousarray(variable[...]), getattr(variable, "_Encoding", "utf-8")
    texts = [row.tobytes().rstrip(b"\0").decode(encoding) for row in letters.reshape(-1, max(letters.shape[-1], 1))]
    return np.array(texts, dtype=object).reshape(letters.shape[:-1])
