"""Rows of an archive as they are stored: their conversion and checksums, and the check that they are what was written.

The worker that simulates a block converts it, so that the writer only writes.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.checksums import crc32
from tolcontact.errors import ArchiveError
from tolcontact.realizations import finished
from tolcontact.simulation import Block
from tolcontact.vocabulary import ArchiveVariable


class StoredBlock(NamedTuple):
    """Realizations `start` to `stop`: the values of each archived variable, by name, and their checksums."""

    start: int
    stop: int
    values: dict[str, np.ndarray]
    checksums: list[int]


def stored(block: Block, names: Sequence[str]) -> StoredBlock:
    """Return a block, converted once for the file and for its checksums; `names` are those of its variables."""
    values = row_values(block, names)
    checksums = [crc32(variable, values[variable.name]) for variable in terms.BY_REALIZATION if variable.name in values]
    return StoredBlock(block.start, block.start + len(block), values, checksums)


def row_values(block: Block, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the values of the variables of these names as they are stored."""
    values = block.values()
    return {
        variable.name: np.ascontiguousarray(values[variable], dtype=variable.kind)
        for variable in terms.BY_REALIZATION
        if variable.name in names
    }


def check_rows(results: xr.DataTree) -> None:
    """Raise ArchiveError if finished realizations are not what was written.

    Archives of format 1 have no checksums; nor are there any for rows that were taken from an archive.
    """
    stored = results.to_dataset()
    count, rows = stored.sizes[terms.REALIZATION], int(stored.attrs.get("block_rows", terms.BLOCK_ROWS))
    samples = int(stored.attrs["samples"])
    if terms.ROW_CHECKSUM.name not in stored or count not in (samples, min(samples, terms.FIRST_ROWS)):
        return
    try:
        for name, block in _damaged(results, stored, rows):
            start, end = block * rows, min((block + 1) * rows, count) - 1
            raise ArchiveError(
                f'the archive is damaged: "{name}" of realizations {start} to {end} is not what was written; run it again'
            )
    except (OSError, RuntimeError) as error:
        raise ArchiveError(f"the archive is damaged: its realizations cannot be read ({error}); run it again") from error


def _damaged(results: xr.DataTree, stored: xr.Dataset, rows: int) -> Iterator[tuple[str, int]]:
    """Yield the variables and blocks of `rows` realizations whose values do not match their checksums."""
    done = finished(results)
    complete = done if done == stored.sizes[terms.REALIZATION] else done // rows * rows
    # Blocks are finished in order: none behind the one that is being written.
    behind = stored[terms.STATUS.name][complete + rows :].values
    if (behind != terms.UNFINISHED).any():
        yield terms.STATUS.name, done // rows
    sums = stored[terms.ROW_CHECKSUM.name].values
    names = stored[terms.ROW_VARIABLE].values.astype(str).tolist()
    for variable in terms.BY_REALIZATION:
        if variable.name in names:
            values = (results["sample"].to_dataset() if variable is terms.DEVIATION else stored)[variable.name][:complete]
            actual, expected = _checksums(variable, values, rows), sums[: -(-complete // rows), names.index(variable.name)]
            wrong = np.flatnonzero(actual != expected)
            yield from ((variable.name, int(block)) for block in wrong[:1])


def _checksums(variable: ArchiveVariable, values: xr.DataArray, rows: int) -> np.ndarray:
    """Return the checksums (block,) of the values of a variable in blocks of `rows` realizations."""
    checksums, step = [], -(-terms.PIECE_ROWS // rows) * rows
    for start in range(0, len(values), step):
        piece = values[start : start + step].values
        checksums += [crc32(variable, piece[k : k + rows]) for k in range(0, len(piece), rows)]
    return np.array(checksums, dtype=np.int64)
