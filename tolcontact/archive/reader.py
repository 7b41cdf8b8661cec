"""Reading an archive with xarray, and checking its realizations."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.archive.inspection import check_archive
from tolcontact.archive.netcdf_files import small_caches
from tolcontact.errors import ArchiveError, OptionError
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
