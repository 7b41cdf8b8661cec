"""Writing an archive block by block.

A file that is being extended breaks when its writer is killed at the wrong moment. So room is laid out first, under another
name: header, and rows with the status "unfinished". Once the file has its own name, bytes are only overwritten in
place, the status of a row after its data. If the process is killed, the file still opens, finished rows stay, and `resume`
continues after the last checkpoint. (Writes are not flushed to the disk: a power failure may lose more.) To get its name
soon, a long run begins with room for few rows; when these are full, a copy gets room for all, and replaces the file.
"""

import contextlib
import shutil
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive.disk_space import check_room, lay_out_rows
from tolcontact.archive.header import empty_field, empty_touching, write_header
from tolcontact.archive.inspection import inspect
from tolcontact.archive.netcdf_library import open_netcdf
from tolcontact.archive.raw_file import RawFile
from tolcontact.archive.reader import open_unchecked
from tolcontact.archive.resuming import check_same_run
from tolcontact.archive.rows import kept_rows
from tolcontact.archive.settings import Run, now, run_settings, versions
from tolcontact.archive.stored_rows import StoredBlock, archived_poses, check_rows, choose, empty_checks
from tolcontact.checksums import crc32
from tolcontact.compilation import Program
from tolcontact.discretization import Nominal
from tolcontact.errors import ArchiveError
from tolcontact.replacing import replacing


class ArchiveWriter:
    """An archive being written, whose file is locked (see `locked_archive`). Use it as a context manager.

    rows      number of realizations in it; the next block starts there
    samples   number of realizations that it was started for
    kept      what it keeps of each realization
    """

    def __init__(self, path: Path, program: Program, run: Run, sums: Sequence[int]) -> None:
        """Create the file with everything but its rows; `sums` is the length of the sums of each part's field.

        Raises ArchiveError if it cannot be written, or if there is no room for it.
        """
        check_room(path, program.nominal, kept_rows(program.nominal, run.keep), run.samples)
        with replacing_archive(path) as part, open_netcdf(part, "w") as file:
            write_header(file, program, run, sums)
            lay_out_rows(file, 0, min(run.samples, terms.FIRST_ROWS))
        self._go_on(path, program.nominal, run.checkpoint_interval)

    @classmethod
    def resume(cls, path: Path, program: Program, run: Run) -> "ArchiveWriter":
        """Open an archive to continue after its last checkpoint, up to the run's samples, or its own number if larger.

        Raises ArchiveError if the file is not an archive, or contains another model or another run.
        """
        inspect(path)
        writer = cls.__new__(cls)
        with replacing_archive(path) as copy:
            # Only the copy is opened: the old file may be open in this process, and HDF5 does not open a file twice.
            shutil.copyfile(path, copy)
            with open_unchecked(copy) as results:
                check_rows(results)
            with open_netcdf(copy, "r+") as file:
                check_same_run(file, path, program, run_settings(program, run), run.surfaces)
                rows = last_checkpoint(file, path, [part.name for part in program.nominal.last_parts]).rows
                samples, length = max(run.samples, int(file.samples)), len(file.dimensions[terms.REALIZATION])
                check_room(path, program.nominal, kept_rows(program.nominal, run.keep), samples - length)
                lay_out_rows(file, length, samples)
                file.setncattr("samples", np.int64(samples))
                software = "" if file.versions == versions() else f" with {versions()}"
                file.setncattr("history", f"{file.history}\n{now()} resumed after {rows} realizations{software}")
            # Fields and checks were of the earlier rows.
            initial = {terms.field_of(part.name): empty_field(len(part.vertices)) for part in program.nominal.last_parts}
            initial["surface"] = empty_checks(run.surfaces, len(program.nominal.pairs))
            initial["contact"] = empty_touching(sum(len(pair.P_m) for pair in program.nominal.pairs))
            with contextlib.closing(RawFile(copy)) as values:
                values.overwrite_together(initial)
        writer._go_on(path, program.nominal, run.checkpoint_interval)
        return writer

    def _go_on(self, path: Path, nominal: Nominal, checkpoint_interval: float) -> None:
        self._path, self._parts, self._pairs = path, [part.name for part in nominal.last_parts], len(nominal.pairs)
        self._stations = [scene.station for scene in nominal.scenes]
        self._checkpoint_interval = checkpoint_interval
        with _as_archive_error(path):
            self._values = RawFile(path)
            with open_netcdf(path, "r") as file:
                self._length, self._block_rows = len(file.dimensions[terms.REALIZATION]), int(file.block_rows)
                self.samples, self._checked = int(file.samples), len(file["surface"].dimensions[terms.CHECKED])
                self._go_back(last_checkpoint(file, path, self._parts))
        self.kept = tuple(row for row in kept_rows(nominal, "all") if self._values.has(row.group, row.variable))

    def load_checkpoint(self) -> list[np.ndarray]:
        """Go back to the last checkpoint, and return its sums of fields, (state, number) for each part; empty without one."""
        with open_netcdf(self._path, "r") as file:
            checkpoint = last_checkpoint(file, self._path, self._parts)
        self._go_back(checkpoint)
        return checkpoint.sums

    def _go_back(self, checkpoint: "Checkpoint") -> None:
        self.rows, self._place = checkpoint.rows, checkpoint.place
        self._since = time.monotonic()

    def __enter__(self) -> "ArchiveWriter":
        return self

    def __exit__(self, *error: object) -> None:
        with _as_archive_error(self._path):
            self._values.close()

    def append(self, block: StoredBlock) -> None:
        """Write the rows of a block to the file."""
        with _as_archive_error(self._path):
            if block.stop > self._length:
                self._make_room_for_all()
            for row in self.kept:
                if row.variable is not terms.STATUS:
                    self._values.overwrite(row.group, row.variable, block.values[row.label], block.start)
            self._values.overwrite("", terms.ROW_CHECKSUM, [block.checksums], block.start // self._block_rows)
            self._values.overwrite("", terms.STATUS, block.values[terms.STATUS.name], block.start)
        self.rows = block.stop

    def _make_room_for_all(self) -> None:
        self._values.close()
        try:
            with replacing_archive(self._path) as part:
                shutil.copyfile(self._path, part)
                with open_netcdf(part, "r+") as file:
                    lay_out_rows(file, self._length, self.samples)
            self._length = self.samples
        finally:  # a run may be stopped here, and still writes its fields
            self._values = RawFile(self._path)

    @property
    def is_between_blocks(self) -> bool:
        """True if the last block is complete: a run can be resumed only there."""
        return self.rows % self._block_rows == 0

    @property
    def is_checkpoint_due(self) -> bool:
        """True if a checkpoint is due: the last one is old, or no complete block will follow."""
        is_old = time.monotonic() >= self._since + self._checkpoint_interval
        is_last = self.rows + self._block_rows > self.samples
        return self.is_between_blocks and (is_old or is_last)

    def write_checkpoint(self, sums: Sequence[np.ndarray]) -> None:
        """Write the sums of the fields (state, number) for each part so far, so that a killed run can continue."""
        with _as_archive_error(self._path):
            place = 1 - self._place
            write_checkpoint(self._values, Checkpoint(self.rows, place, list(sums)), self._parts)
            self._place = place  # not before: one that is interrupted is written again, the other one stays
        self._since = time.monotonic()

    def write_fields(self, fields: Sequence[dict[terms.ArchiveVariable, Any]]) -> None:
        """Write displacement fields: for each part the values of `FIELDS`."""
        with _as_archive_error(self._path):
            self._values.overwrite_together(
                {terms.field_of(part): values for part, values in zip(self._parts, fields, strict=True)}
            )

    def rows_to_check(self, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers (row,) of the realizations to check against the surfaces, and whether each is a random choice."""
        with open_netcdf(self._path, "r") as file:
            return choose(file, self._checked, seed)

    def poses(self, rows: np.ndarray) -> np.ndarray | None:
        """Return corrected poses (row, part, 12) of some rows; None if they are not kept."""
        with open_netcdf(self._path, "r") as file:
            return archived_poses(file, rows, self._stations)

    def first_poses(self, end: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers (row,) of the first rows, before `end`, that are not `searched`, and their corrected poses.

        poses   (row, part, 12), which the archive has to keep
        """
        with open_netcdf(self._path, "r") as file:
            rows = np.flatnonzero(file[terms.SEARCHED.name][:end] == 0)
            poses = archived_poses(file, rows, self._stations)
        assert poses is not None
        return rows, poses

    def write_checked(self, rows: np.ndarray, at_random: np.ndarray, findings: Iterable[np.ndarray]) -> None:
        """Write the findings (row, pair) of the check of some rows, in the order of SURFACE in the vocabulary."""
        values = empty_checks(self._checked, self._pairs)
        for variable, array in zip(terms.SURFACE, (rows, *findings, at_random), strict=True):
            values[variable][: len(rows)] = array
        with _as_archive_error(self._path):
            self._values.overwrite_together({"surface": values})

    def write_touching(self, share: np.ndarray, interval: np.ndarray, realizations: int) -> None:
        """Write the share of realizations in which each contact point touches (point,), with its interval (point, bound)."""
        with _as_archive_error(self._path):
            values = dict(zip(terms.TOUCHING, (share, interval, realizations), strict=True))
            self._values.overwrite_together({"contact": values})


@contextlib.contextmanager
def replacing_archive(path: Path) -> Iterator[Path]:
    """Yield the path of a new file to write to, which then replaces `path`. Raises ArchiveError if that cannot be done."""
    with _as_archive_error(path), replacing(path) as part:
        yield part


@contextlib.contextmanager
def _as_archive_error(path: Path) -> Iterator[None]:
    """Raise errors of the system or the netCDF library (a full disk, for example) as ArchiveError."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or f"{error} (is the disk full?)"
        raise ArchiveError(f'archive "{path}" cannot be written: {reason}') from error


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


def write_checkpoint(archive: RawFile, checkpoint: Checkpoint, parts: Sequence[str]) -> None:
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
