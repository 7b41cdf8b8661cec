"""Checkpoints: the sums of displacement fields up to some realization, from which a killed run goes on.

There are two places for them: the last ones stay until the next ones are written. A checkpoint is written once the rows that
it sums up are, and counts only when all of it is there: a run that is killed while it writes one goes on from the other.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive.raw_file import LaidOut
from tolcontact.checksums import crc32
from tolcontact.errors import ArchiveError


class Checkpoint(NamedTuple):
    """Sums (state, number) for each part over the first `rows` realizations, none if nothing is summed up; and their place."""

    rows: int
    place: int
    sums: list[np.ndarray]


def last_checkpoint(file: netCDF4.Dataset, path: Path, parts: Sequence[str]) -> Checkpoint:
    """Return the last checkpoint of an archive. Raises ArchiveError if it is not what was written."""
    summed = np.ma.getdata(file[terms.SUMMED_ROWS.name][:])
    place = int(summed.argmax())
    rows, sums = max(0, int(summed[place])), []
    for part in parts if rows else ():
        group = file[terms.field_of(part)]
        sums.append(np.ma.getdata(group[terms.FIELD_SUMS.name][place]))
        if _checksum(rows, sums[-1]) != int(group[terms.SUMS_CHECKSUM.name][place]):
            raise ArchiveError(
                f'archive "{path}" is damaged: the sums of the field of part "{part}" are not what was written; write to '
                "a new file"
            )
    return Checkpoint(rows, place, sums)


def write_checkpoint(archive: LaidOut, checkpoint: Checkpoint, parts: Sequence[str]) -> None:
    """Write a checkpoint to its place."""
    archive.overwrite("", terms.SUMMED_ROWS, [terms.UNFINISHED], checkpoint.place)
    for part, of_part in zip(parts, checkpoint.sums, strict=True):
        archive.overwrite(terms.field_of(part), terms.FIELD_SUMS, of_part[None], checkpoint.place)
        checksum = _checksum(checkpoint.rows, of_part)
        archive.overwrite(terms.field_of(part), terms.SUMS_CHECKSUM, [checksum], checkpoint.place)
    archive.overwrite("", terms.SUMMED_ROWS, [checkpoint.rows], checkpoint.place)


def _checksum(rows: int, sums: np.ndarray) -> int:
    """Return the checksum of the sums together with their number of realizations, so that neither matches alone."""
    return crc32(terms.FIELD_SUMS, sums, crc32(terms.SUMMED_ROWS, rows))
