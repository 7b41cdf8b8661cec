"""The files next to an archive during a run: its lock, and the journal of realizations that are not in the archive yet.

A file that the netCDF library extends breaks if its writer is killed at the wrong moment. So a run appends its realizations to
a plain file. From time to time it writes a checkpoint: up to where this file is valid, and the sums of the displacement fields.
At the end a copy of the archive takes the realizations, and replaces the archive. The journal of a killed run stays, and a
resumed run puts it into the archive first. (A power failure may lose more: writes are not flushed to the disk.)
"""

import contextlib
import math
import os
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple

import netCDF4
import numpy as np
from filelock import FileLock, Timeout

from tolcontact import vocabulary as terms
from tolcontact.archive.inspection import check_ending, check_name
from tolcontact.archive.rows import Row
from tolcontact.errors import ArchiveError, OptionError
from tolcontact.replacing import folder_fault, remove_abandoned, replacing
from tolcontact.system import files

WRITTEN_BYTES = 1 << 24  # that the netCDF library writes together; each call takes as long as many realizations
LONGEST_SUFFIX = f".checkpoint.{'0' * 8}.part"  # of the working files of a run
UNREADABLE = OSError, EOFError, RuntimeError, ValueError, KeyError, zipfile.BadZipFile  # what a damaged checkpoint raises


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
            self._check_not_renamed(archive)
            return None
        except UNREADABLE as error:
            raise self._damaged(self._checkpoint) from error
        if of_archive != archive:
            return None
        if self._checksum(size) != checksum:
            raise self._damaged(self._rows)
        return Checkpoint(archive, rows, size, checksum, samples, sums)

    def _check_not_renamed(self, archive: str) -> None:
        """Raise ArchiveError if the journal of the archive of that history has the name of a file that is gone."""
        for other in self._checkpoint.parent.glob(".*.checkpoint"):
            former, history = other.name.removeprefix(".").removesuffix(".checkpoint"), None
            with contextlib.suppress(*UNREADABLE), np.load(other) as file:
                history = str(file["state"][0])
            if history == archive and not other.with_name(former).exists():
                raise ArchiveError(
                    f'the archive was named "{former}" when its run was killed; rename ".{former}.rows" to '
                    f'"{self._rows.name}" and "{other.name}" to "{self._checkpoint.name}", which hold realizations '
                    "that are not in the archive yet, or delete them, and resume"
                )

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


@contextlib.contextmanager
def locked_archive(path: str | Path, *, overwrite: bool = False, resume: bool = False) -> Iterator[Path]:
    """Lock the file that `path` refers to (the target of a link) against other runs, and yield its path.

    The system releases the lock of a run that was killed.
    Raises ArchiveError, and changes nothing, if the file cannot become an archive, or another run writes to it.
    """
    if overwrite and resume:
        raise OptionError("an archive cannot be overwritten and resumed; choose one of the two")
    real = Path(os.path.realpath(path))
    check_name(real)
    if fault := folder_fault(real):
        raise ArchiveError(f'archive "{path}" cannot be written: {fault}')
    if real.exists() and not real.is_file():
        raise ArchiveError(f'archive "{path}" cannot be written: it is not a file')
    check_ending(path)
    lock = real.with_name(f".{real.name}.lock")
    holding = FileLock(lock, timeout=0)
    try:
        _acquire(holding, lock, path)
        remove_abandoned(real)
        if real.exists():
            _check_replaceable(path, real, is_allowed=overwrite or resume)
        yield real
    finally:
        # A run that is stopped between making and locking the file removes it too, unless it is another run's.
        with contextlib.suppress(OSError):
            holding.acquire()
            # A run that opened it meanwhile detects that it is removed, and tries again.
            files.remove_held(lock, lambda: holding.release(force=True))


def _acquire(holding: FileLock, lock: Path, path: str | Path) -> None:
    try:
        # Fails with a reason if it cannot be made. The lock itself does not say one.
        files.check_length(lock.with_suffix(LONGEST_SUFFIX))
        files.make_writable(lock)
        files.plain_path(lock)  # else the library would fail at the end of the run
        holding.acquire()
    except Timeout as error:
        raise ArchiveError(f'archive "{path}" is being written by another run; wait, or write to a new file') from error
    except OSError as error:
        raise ArchiveError(f'archive "{path}" cannot be written: {error.strerror}') from error


def _check_replaceable(path: str | Path, real: Path, *, is_allowed: bool) -> None:
    with real.open("rb") as file:  # netCDF files begin like this, or are empty
        is_netcdf = file.read(8).startswith((b"\x89HDF\r\n\x1a\n", b"CDF\1", b"CDF\2", b"CDF\5")) or not real.stat().st_size
    if not is_netcdf:
        raise ArchiveError(f'"{path}" is no netCDF file, and only these are replaced; choose another name, or remove it first')
    if not is_allowed:
        raise ArchiveError(
            f'archive "{path}" exists; choose another name, replace it (--overwrite, overwrite=True) or continue it '
            "(--resume, resume=True)"
        )
    if not os.access(real, os.W_OK):
        raise ArchiveError(f'archive "{path}" cannot be written: it is read-only')
