"""Room for the rows of an archive: on the disk, and in the file."""

import shutil
from collections.abc import Sequence
from math import prod
from pathlib import Path

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive.rows import Row, kept_rows, stored_variables
from tolcontact.archive.variables import rows_together, sizes_of_rows
from tolcontact.discretization import Nominal
from tolcontact.errors import ArchiveError

CHUNKS = 8  # laid out in one write


def check_room(path: Path, nominal: Nominal, rows: Sequence[Row], samples: int) -> None:
    """Raise ArchiveError if the disk has no room for `samples` more realizations of the variables `rows`."""
    needed, free = samples * bytes_of_row(nominal, rows), shutil.disk_usage(path.parent).free
    if needed > free:
        keeps_poses = any(row.variable is terms.ROTATION for row in rows)
        advice = ", or keep less of each realization (measures)" if keeps_poses else ""
        raise ArchiveError(
            f'archive "{path}" needs {size_in_words(needed)} for {samples} realizations, but its disk has '
            f"{size_in_words(free)} free; ask for fewer, write to another disk{advice}"
        )


def bytes_of_rows(nominal: Nominal, keep: str, samples: int) -> int:
    """Return the size of `samples` realizations in an archive with the option `keep` [bytes]."""
    return samples * bytes_of_row(nominal, kept_rows(nominal, keep))


def bytes_of_row(nominal: Nominal, rows: Sequence[Row]) -> int:
    """Return the size of one realization [bytes]."""
    sizes = {terms.REALIZATION: 1, **sizes_of_rows(nominal)}
    stations = {terms.station_group(scene.station): {terms.STATION_PART: len(scene.assembly.parts)} for scene in nominal.scenes}
    return sum(
        np.dtype(row.variable.kind).itemsize * prod((sizes | stations.get(row.group, {}))[dim] for dim in row.variable.dims)
        for row in (Row("", terms.NUMBERS), *rows)
    )


def size_in_words(count: float) -> str:
    """Return a number of bytes with a readable unit: 1.5 GB."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


def lay_out_rows(file: netCDF4.Dataset, start: int, stop: int) -> None:
    """Lay out rows `start` to `stop`: numbered, unfinished, and with their place in the file."""
    for stored, variable in stored_variables(file):
        if 0 not in stored.shape[1:]:
            initial = np.nan if np.dtype(variable.kind).kind == "f" else terms.UNFINISHED
            stored.set_var_chunk_cache(0)  # whole chunks go straight to the file
            rows = CHUNKS * rows_together(np.dtype(variable.kind).itemsize * prod(stored.shape[1:]))
            piece = np.full((min(rows, stop - start), *stored.shape[1:]), initial, dtype=variable.kind)
            for begin in range(start, stop, rows):
                end = min(begin + rows, stop)
                stored[begin:end] = piece[: end - begin]
    for begin in range(start, stop, terms.PIECE_ROWS):
        end = min(begin + terms.PIECE_ROWS, stop)
        file[terms.REALIZATION][begin:end] = np.arange(begin, end)
    sums = file[terms.ROW_CHECKSUM.name]
    blocks = slice(len(sums), -(-stop // int(file.block_rows)))
    if blocks.stop > blocks.start:
        sums[blocks] = np.full((blocks.stop - blocks.start, sums.shape[1]), terms.UNFINISHED)
