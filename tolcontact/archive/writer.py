"""An archive is written block by block.

A file that is being extended breaks when its writer is killed at the wrong moment. So everything is laid out first, under
another name: header, and room for all rows, each with the status "unfinished". Once the file stands under its own name,
bytes are only overwritten in place, the status of a row after its data; whatever kills the process, the file opens,
finished rows stay, and `resume` goes on after them. (Nothing waits for the disk: a machine that loses power may lose more.)
"""

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import netCDF4
import numpy as np

from tolcontact import vocabulary as words
from tolcontact.archive.checked import archived_poses, choose, nothing_checked
from tolcontact.archive.header import now, run_settings, versions, write_header
from tolcontact.archive.reader import open_archive
from tolcontact.archive.same_run import check_same_run
from tolcontact.archive.variables import ROW_CHUNK
from tolcontact.discretization import Nominal, NominalPart, movers
from tolcontact.errors import ArchiveError
from tolcontact.simulation import Block
from tolcontact.statistics import FieldMoments
from tolcontact.symbolic import Program
from tolcontact.vocabulary import Variable

_HDF_ERROR = -101  # of the netCDF library
ROOM = 50 * ROW_CHUNK  # rows that are laid out at once


class ArchiveWriter:
    """An archive being written. Use it as a context manager.

    rows      realizations that are in it with all that is known of them; the next block starts there
    samples   realizations that it has room for
    """

    def __init__(self, path: Path, program: Program, *, seed: int, samples: int, keep: str, surfaces: int) -> None:
        """Create the file with everything but its rows. `keep` says what it will hold of each realization, and `surfaces` how
        many will be checked against the surfaces (see `run`).

        Raises ArchiveError where it cannot be written.
        """
        with _replacing(path) as part, _opened(part, "w") as file:
            write_header(file, program, run_settings(program, seed, samples, keep), surfaces)
            _make_room(file, 0, samples)
        self._go_on(path, program.nominal)

    @classmethod
    def resume(cls, path: Path, program: Program, *, seed: int, samples: int, keep: str, surfaces: int) -> "ArchiveWriter":
        """Open an archive to go on after its last checkpoint, up to `samples`, or to its own number if that is larger.

        Raises ArchiveError where the file is no archive, or holds another model or another run.
        """
        writer = cls.__new__(cls)
        with _replacing(path) as part:
            # Only the copy is opened: whoever reads the old file in this process may go on, HDF5 bears no file opened twice.
            shutil.copyfile(path, part)
            open_archive(part, shown=path).close()
            with _opened(part, "r+") as file:
                check_same_run(file, path, program, run_settings(program, seed, samples, keep), surfaces)
                length = len(file.dimensions[words.REALIZATION])
                _make_room(file, length, samples)
                file.setncattr("samples", np.int64(max(samples, length)))
                rows = max(0, int(file[words.SUMMED_ROWS.name][:].max()))
                others = "" if file.versions == versions() else f" with {versions()}"
                file.setncattr("history", f"{file.history}\n{now()} resumed after {rows} realizations{others}")
                # What follows stands for the rows of before.
                for variable, nothing in nothing_checked(surfaces, len(program.nominal.pairs)).items():
                    file["surface"][variable.name][...] = nothing
                for each in program.nominal.parts:
                    for variable in words.FIELDS:
                        file[f"field/{each.name}"][variable.name][...] = np.nan
        writer._go_on(path, program.nominal)
        return writer

    def _go_on(self, path: Path, nominal: Nominal) -> None:
        """Open the file and take up the sums of its last checkpoint."""
        with _refusals_told(path):
            self._path, self._file = path, _opened(path, "r+")
        self._nominal = nominal
        self.samples = len(self._file.dimensions[words.REALIZATION])
        self._moments = [_of_states(nominal, part) for part in nominal.parts]
        summed = np.asarray(self._file[words.SUMMED_ROWS.name][:])
        self._slot = int(summed.argmax())
        self.rows = max(0, int(summed[self._slot]))
        if self.rows:
            for part, both in zip(nominal.parts, self._moments, strict=True):
                for state, moments in enumerate(both):
                    moments.state = np.asarray(self._file[f"field/{part.name}"][words.FIELD_SUMS.name][self._slot, state])

    def __enter__(self) -> "ArchiveWriter":
        return self

    def __exit__(self, *error: object) -> None:
        with _refusals_told(self._path):
            self._file.close()

    def append(self, block: Block) -> None:
        """Write the rows of a block, and hand them over to the system."""
        with _refusals_told(self._path):
            self._append(block)

    def _append(self, block: Block) -> None:
        rows = slice(block.start, block.start + len(block))
        R, t = block.poses[..., :9].reshape(*block.poses.shape[:3], 3, 3), block.poses[..., 9:]
        self._add_to_fields(R, t)
        values = {
            words.MEASURED: block.measured,
            words.TRANSLATION: t,
            words.ROTATION: R,
            words.GAP_MIN: block.gap_min,
            words.ACTIVE: block.active,
            words.CARRYING: block.carrying,
            words.REACTION: block.reaction,
            words.KKT_RESIDUAL: block.kkt_residual,
            words.ITERATIONS: block.iterations,
            words.STARTS: block.starts,
            words.SECOND_ANSWERS: block.second_answers,
            words.SEARCHED: block.searched,
        }
        if words.DEVIATION.name in self._file["sample"].variables:
            self._file["sample"][words.DEVIATION.name][rows] = block.deviations
        for variable, data in values.items():
            if data.size and variable.name in self._file.variables:
                self._file[variable.name][rows] = data
        self._file.sync()
        self._file[words.STATUS.name][rows] = block.status
        self._file.sync()
        self.rows = rows.stop

    def _add_to_fields(self, R: np.ndarray, t: np.ndarray) -> None:
        for part, both in enumerate(self._moments):
            for state, moments in enumerate(dict.fromkeys(both)):
                moments.add(R[:, state, part], t[:, state, part])

    def check_point(self) -> None:
        """Write the sums so far, from which a killed run goes on. The last ones stay until these are written."""
        with _refusals_told(self._path):
            self._check_point()

    def _check_point(self) -> None:
        self._slot = 1 - self._slot
        self._file[words.SUMMED_ROWS.name][self._slot] = -1
        self._file.sync()
        for part, both in zip(self._nominal.parts, self._moments, strict=True):
            sums = self._file[f"field/{part.name}"][words.FIELD_SUMS.name]
            for state, moments in enumerate(both):
                sums[self._slot, state] = moments.state
        self._file.sync()
        self._file[words.SUMMED_ROWS.name][self._slot] = self.rows
        self._file.sync()

    def write_fields(self) -> None:
        """Displacement fields of all parts, from the sums over all rows."""
        with _refusals_told(self._path):
            self._write_fields()

    def chosen(self, seed: int) -> np.ndarray:
        """Numbers (row,) of the realizations that are to be checked against the surfaces."""
        return choose(self._file, len(self._file["surface"].dimensions[words.CHECKED]), seed)

    def poses(self, rows: np.ndarray) -> np.ndarray | None:
        """Corrected poses (row, part, 12) of some rows; None where they are not kept."""
        return archived_poses(self._file, rows)

    def write_checked(self, rows: np.ndarray, penetration: np.ndarray, beside: np.ndarray) -> None:
        """What the check of some rows found, (row, pair) [mm]."""
        with _refusals_told(self._path):
            found = {words.SURFACE_PENETRATION: penetration, words.BESIDE: beside, words.CHECKED_REALIZATION: rows}
            for variable, values in found.items():
                if values.size:
                    self._file["surface"][variable.name][: len(rows)] = values
            self._file.sync()

    def _write_fields(self) -> None:
        for part, both in zip(self._nominal.parts, self._moments, strict=True):
            group = self._file[f"field/{part.name}"]
            for state, moments in enumerate(both):
                group[words.FIELD_MEAN.name][state] = moments.mean()
                group[words.FIELD_SIX_SIGMA.name][state] = moments.six_sigma()
                group[words.FIELD_INTERVAL.name][state] = moments.magnitude_bounds()
        self._file.sync()


def _of_states(nominal: Nominal, part: NominalPart) -> list[FieldMoments]:
    """Sums of the raw and of the corrected field, which are one where contact cannot move the part."""
    raw = FieldMoments(part.vertices)
    return [raw, FieldMoments(part.vertices) if movers(nominal.assembly, part.part) else raw]


@contextlib.contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """A name beside `path` to write under; what was written takes the place of `path` when it is whole."""
    _refuse_while_written(path)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with _refusals_told(path):
            yield part
            part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _refuse_while_written(path: Path) -> None:
    """HDF5 locks a file that somebody writes to; replacing it would take it away from them."""
    if path.is_file():
        try:
            netCDF4.Dataset(path).close()
        except OSError as error:
            if error.errno == _HDF_ERROR:
                raise ArchiveError(
                    f'archive "{path}" is being written by another run, or damaged; wait, delete it, or write to a new file'
                ) from error


@contextlib.contextmanager
def _refusals_told(path: Path) -> Iterator[None]:
    """What the system or the netCDF library refuses (a full disk, say) as an ArchiveError."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or f"{error} (is the disk full?)"
        raise ArchiveError(f'archive "{path}" cannot be written: {reason}') from error


def _make_room(file: netCDF4.Dataset, start: int, stop: int) -> None:
    """Lay out rows `start` to `stop`: numbered, unfinished, and with their place in the file."""
    counts = (
        words.STATUS, words.ACTIVE, words.CARRYING, words.ITERATIONS, words.STARTS, words.SECOND_ANSWERS, words.SEARCHED,
    )  # fmt: skip
    room: dict[Variable, float] = dict.fromkeys(counts, words.UNFINISHED)
    for variable in (*words.ROWS, words.DEVIATION):
        stored = (file["sample"] if variable is words.DEVIATION else file).variables.get(variable.name)
        if stored is None or 0 in stored.shape[1:]:
            continue
        for first in range(start, stop, ROOM):
            rows = min(ROOM, stop - first)
            stored[first : first + rows] = np.full((rows, *stored.shape[1:]), room.get(variable, np.nan))
    for first in range(start, stop, ROOM):
        last = min(first + ROOM, stop)
        file[words.REALIZATION][first:last] = np.arange(first, last)


def _opened(path: Path, mode: Literal["w", "r+"]) -> netCDF4.Dataset:
    return netCDF4.Dataset(path, mode, format="NETCDF4")
