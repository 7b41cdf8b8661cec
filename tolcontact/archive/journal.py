"""The journal of a run: the finished realizations that are not in its archive yet.

A file that the netCDF library extends breaks if its writer is killed at the wrong moment. So a run appends its realizations to
a plain file. From time to time it writes a checkpoint: up to where this file is valid, and the sums of the displacement fields.
At the end a copy of the archive takes the realizations, and replaces the archive. The journal of a killed run stays, and a
resumed run puts it into the archive first. (A power failure may lose more: writes are not flushed to the disk.)
"""

import math
import zipfile
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive.rows import Row
from tolcontact.errors import ArchiveError
from tolcontact.replacing import remove_abandoned, replacing
from tolcontact.system import files

WRITTEN_BYTES = 1 << 24  # that the netCDF library writes together; each call takes as long as many realizations


class Checkpoint(NamedTuple):
    """A state of a run that a killed run resumes from.

    archive   the history of the archive: a journal belongs to one archive only
    rows      number of realizations in the archive and the journal
    size      size of the journal [bytes]
    checksum  CRC-32 of these bytes
    samples   number of realizations that the run was started for
    sums      sums of the displacement field for each part, (state, number), over these realizations
    """

    archive: str
    rows: int
    size: int
    checksum: int
    samples: int
    sums: list[np.ndarray]


class Journal:
    """The files of a journal next to an archive, for the variables `kept` in blocks of `block` realizations."""

    def __init__(self, archive: Path, kept: Sequence[Row], block: int) -> None:
        self._rows, self._checkpoint = (archive.with_name(f".{archive.name}.{name}") for name in ("rows", "checkpoint"))
        self._kept, self._block = kept, block
        self.size = self.checksum = 0

    def append(self, arrays: Iterable[np.ndarray]) -> None:
        """Append the values of a block, for each variable (realization, ...)."""
        checksum = self.checksum
        with self._rows.open("r+b" if self.size else "wb") as file:
            file.seek(self.size)
            for array in arrays:
                values = np.ascontiguousarray(array).reshape(-1).view(np.uint8).data
                file.write(values)
                checksum = zlib.crc32(values, checksum)
            size = file.tell()
        self.size, self.checksum = size, checksum

    def write_checkpoint(self, checkpoint: Checkpoint) -> None:
        """Replace the checkpoint."""
        with replacing(self._checkpoint) as part, part.open("wb") as file:
            np.savez(file, *checkpoint.sums, state=checkpoint[:-1])

    def checkpoint(self, archive: str) -> Checkpoint | None:
        """Return the last checkpoint of a killed run on the archive of that history; None if there is none.

        Raises ArchiveError if it is damaged, or if the journal is: some of its realizations are lost.
        """
        try:
            with np.load(self._checkpoint) as file:
                of_archive, *numbers = file["state"].tolist()
                rows, size, checksum, samples = map(int, numbers)
                sums = [file[f"arr_{number}"] for number in range(len(file.files) - 1)]
        except FileNotFoundError:
            return None
        except (OSError, EOFError, RuntimeError, ValueError, KeyError, zipfile.BadZipFile) as error:
            raise self._damaged(self._checkpoint) from error
        if of_archive != archive:
            return None
        if self._checksum(size) != checksum:
            raise self._damaged(self._rows)
        return Checkpoint(archive, rows, size, checksum, samples, sums)

    def _checksum(self, size: int) -> int | None:
        """Return the CRC-32 of the first `size` bytes of the journal; None if it does not have as many."""
        checksum = 0
        try:
            with self._rows.open("rb") as file:
                while size > 0 and (values := file.read(min(size, WRITTEN_BYTES))):
                    checksum, size = zlib.crc32(values, checksum), size - len(values)
        except FileNotFoundError:
            return None
        return checksum if size == 0 else None

    def _damaged(self, path: Path) -> ArchiveError:
        return ArchiveError(
            f'"{path}" is damaged: it has realizations of a killed run that are not in the archive yet; delete '
            f'"{self._rows.name}" and "{self._checkpoint.name}", and resume: they are simulated again'
        )

    def put_into(self, file: netCDF4.Dataset, start: int, stop: int) -> None:
        """Write the realizations `start` to `stop`, the first ones in the journal, to an archive."""
        if start == stop:
            return
        variables = [file[row.path] for row in self._kept]
        row_bytes = sum(stored.dtype.itemsize * math.prod(stored.shape[1:]) for stored in variables)
        step = max(1, WRITTEN_BYTES // (self._block * row_bytes)) * self._block
        with self._rows.open("rb") as journal:
            for begin in range(start, stop, step):
                end = min(begin + step, stop)
                counts = [min(self._block, end - first) for first in range(begin, end, self._block)]
                blocks = [[_read(journal, stored, count) for stored in variables] for count in counts]
                for stored, arrays in zip(variables, zip(*blocks, strict=True), strict=True):
                    stored[begin:end] = np.concatenate(arrays)
                file[terms.REALIZATION][begin:end] = np.arange(begin, end)

    def remove(self) -> None:
        """Remove the files."""
        self.size = self.checksum = 0
        remove_abandoned(self._checkpoint)
        files.remove(self._checkpoint)
        files.remove(self._rows)


def _read(journal: BinaryIO, stored: netCDF4.Variable, count: int) -> np.ndarray:
    """Return the next values in a journal, which are the values of a variable in `count` realizations."""
    shape = (count, *stored.shape[1:])
    return np.fromfile(journal, stored.dtype, math.prod(shape)).reshape(shape)
