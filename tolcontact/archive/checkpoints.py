"""Checkpoints: the sums of displacement fields up to some realization, from which a killed run goes on.

There are two places for them: the last ones stay until the next ones are written. A checkpoint is written before the
statuses of its last block are, and counts only when these are there, too: a run that is killed while it writes one goes on from
the other.
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
    summed = np.where(summed <= _finished(file), summed, words.UNFINISHED)
    place = int(summed.argmax())
    rows, found = max(0, int(summed[place])), []
    for part in parts if rows else ():
        group = file[words.field_of(part)]
        found.append(np.ma.getdata(group[words.FIELD_SUMS.name][place]))
        if _checksum(rows, found[-1]) != int(group[words.SUMS_CHECKSUM.name][place]):
            raise ArchiveError(
                f'archive "{path}" is damaged: the sums of the field of part "{part}" are not what was written; write to '
                "a new file"
            )
    return Checkpoint(rows, place, found)


def write_checkpoint(file: netCDF4.Dataset, checkpoint: Checkpoint, parts: Sequence[str]) -> None:
    """Write a checkpoint to its place."""
    for part, of_part in zip(parts, checkpoint.sums, strict=True):
        group = file[words.field_of(part)]
        group[words.FIELD_SUMS.name][checkpoint.place] = of_part
        group[words.SUMS_CHECKSUM.name][checkpoint.place] = _checksum(checkpoint.rows, of_part)
    file[words.SUMMED_ROWS.name][checkpoint.place] = checkpoint.rows


def _checksum(rows: int, sums: np.ndarray) -> int:
    """Of the sums and of how many realizations they are: one written without the other has another one."""
    return crc32(words.FIELD_SUMS, sums, crc32(words.SUMMED_ROWS, rows))


def _finished(file: netCDF4.Dataset) -> int:
    """How many realizations, from the first on, are finished."""
    unfinished = np.flatnonzero(np.ma.getdata(file[words.STATUS.name][:]) == words.UNFINISHED)
    return int(unfinished[0]) if unfinished.size else len(file.dimensions[words.REALIZATION])
