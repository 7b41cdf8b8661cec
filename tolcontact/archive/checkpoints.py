"""Checkpoints: the sums of displacement fields up to some realization, from which a killed run goes on.

There are two places for them: the last ones stay until the next ones are written.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import netCDF4
import numpy as np

from tolcontact import vocabulary as words
from tolcontact.checksums import crc32
from tolcontact.errors import ArchiveError


class Checkpoint(NamedTuple):
    """Sums (state, number) for each part over the first `rows` realizations, none if nothing is summed up; and their place."""

    rows: int
    place: int
    sums: list[np.ndarray]


def last_checkpoint(file: netCDF4.Dataset, path: Path, parts: Sequence[str]) -> Checkpoint:
    """The last checkpoint of an archive. Raises ArchiveError if it is not what was written."""
    summed = np.ma.getdata(file[words.SUMMED_ROWS.name][:])
    place = int(summed.argmax())
    rows, found = max(0, int(summed[place])), []
    for part in parts if rows else ():
        group = file[words.field_of(part)]
        found.append(np.ma.getdata(group[words.FIELD_SUMS.name][place]))
        if crc32(words.FIELD_SUMS, found[-1]) != int(group[words.SUMS_CHECKSUM.name][place]):
            raise ArchiveError(
                f'archive "{path}" is damaged: the sums of the field of part "{part}" are not what was written; write to '
                "a new file"
            )
    return Checkpoint(rows, place, found)


def write_checkpoint(file: netCDF4.Dataset, place: int, parts: Sequence[str], rows: int, sums: Sequence[np.ndarray]) -> None:
    """Write sums over the first `rows` realizations to a place."""
    file[words.SUMMED_ROWS.name][place] = words.UNFINISHED
    file.sync()
    for part, of_part in zip(parts, sums, strict=True):
        group = file[words.field_of(part)]
        group[words.FIELD_SUMS.name][place] = of_part
        group[words.SUMS_CHECKSUM.name][place] = crc32(words.FIELD_SUMS, of_part)
    file.sync()
    file[words.SUMMED_ROWS.name][place] = rows
    file.sync()
