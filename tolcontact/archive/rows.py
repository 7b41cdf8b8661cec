"""Whether the realizations of an archive are what was written."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from tolcontact import vocabulary as words
from tolcontact.checksums import crc32
from tolcontact.errors import ArchiveError
from tolcontact.statistics import finished
from tolcontact.vocabulary import Variable

PIECE = 24 * words.BLOCK_ROWS  # realizations that are read at once


def check_rows(results: xr.DataTree) -> None:
    """Raise ArchiveError where finished realizations are not what was written.

    Archives of format 1 have no checksums; nor are there any of the rows that somebody took from an archive.
    """
    stored = results.to_dataset()
    count = stored.sizes[words.REALIZATION]
    if words.ROW_CHECKSUM.name not in stored or stored.sizes[words.BLOCK] != -(-count // words.BLOCK_ROWS):
        return
    try:
        for name, block in _damaged(results, stored, count):
            first, last = block * words.BLOCK_ROWS, min((block + 1) * words.BLOCK_ROWS, count) - 1
            raise ArchiveError(
                f'the archive is damaged: "{name}" of realizations {first} to {last} is not what was written; run it again'
            )
    except (OSError, RuntimeError) as error:
        raise ArchiveError(f"the archive is damaged: its realizations cannot be read ({error}); run it again") from error


def _damaged(results: xr.DataTree, stored: xr.Dataset, count: int) -> Iterator[tuple[str, int]]:
    """Variables and blocks that do not have their checksums."""
    done = finished(results)
    whole = done if done == count else done // words.BLOCK_ROWS * words.BLOCK_ROWS
    # Blocks are finished in order: none behind the one that is being written.
    behind = stored[words.STATUS.name][whole + words.BLOCK_ROWS :].values
    if (behind != words.UNFINISHED).any():
        yield words.STATUS.name, done // words.BLOCK_ROWS
    sums = stored[words.ROW_CHECKSUM.name].values
    names = stored[words.ROW_VARIABLE].values.astype(str).tolist()
    for variable in words.BY_REALIZATION:
        if variable.name in names:
            rows = (results["sample"].to_dataset() if variable is words.DEVIATION else stored)[variable.name][:whole]
            wrong = np.flatnonzero(
                _checksums(variable, rows) != sums[: -(-whole // words.BLOCK_ROWS), names.index(variable.name)]
            )
            yield from ((variable.name, int(block)) for block in wrong[:1])


def _checksums(variable: Variable, rows: xr.DataArray) -> np.ndarray:
    """Checksums (block,) of the values of a variable."""
    found = []
    for first in range(0, len(rows), PIECE):
        piece = rows[first : first + PIECE].values
        found += [crc32(variable, piece[k : k + words.BLOCK_ROWS]) for k in range(0, len(piece), words.BLOCK_ROWS)]
    return np.array(found, dtype=np.int64)
