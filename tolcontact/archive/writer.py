"""An archive is written block by block.

A file that is being extended breaks when its writer is killed at the wrong moment. So room is laid out first, under another
name: header, and rows with the status "unfinished". Once the file stands under its own name, bytes are only overwritten in
place, the status of a row after its data; whatever kills the process, the file opens, finished rows stay, and `resume` goes
on after them. (Nothing waits for the disk: a machine that loses power may lose more.) To stand there soon, a long run begins
with room for few rows; when these are full, a copy gets room for all, and takes its place.
"""

import contextlib
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import netCDF4
import numpy as np

from tolcontact import vocabulary as words
from tolcontact.archive.checked import archived_poses, choose, nothing_checked
from tolcontact.archive.header import kept_rows, no_field, now, run_settings, versions, write_header
from tolcontact.archive.inspection import inspect
from tolcontact.archive.reader import opened
from tolcontact.archive.resuming import check_same_run
from tolcontact.archive.room import check_room, lay_out_rows
from tolcontact.archive.rows import check_rows
from tolcontact.archive.variables import overwrite
from tolcontact.checksums import crc32
from tolcontact.compilation import Program
from tolcontact.declaration import movers
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.errors import ArchiveError
from tolcontact.simulation import Block
from tolcontact.statistics import FieldMoments

FIELDS_EVERY = 2.0  # s: how old the fields of a run that is killed may be


class ArchiveWriter:
    """An archive being written, whose name is taken (see `taken`). Use it as a context manager.

    rows      realizations that are in it with all that is known of them; the next block starts there
    samples   realizations that it was begun for
    block_rows   realizations of a block, all but the last one
    """

    def __init__(self, path: Path, program: Program, *, seed: int, samples: int, keep: str, surfaces: int) -> None:
        """Create the file with everything but its rows. `keep` says what it will hold of each realization, and `surfaces` how
        many will be checked against the surfaces (see `run`).

        Raises ArchiveError where it cannot be written, or where there is no room for it.
        """
        check_room(path, program.nominal, kept_rows(keep), samples)
        with _replacing(path) as part, _opened(part, "w") as file:
            write_header(file, program, run_settings(program, seed, samples, keep), surfaces)
            lay_out_rows(file, 0, min(samples, words.FIRST_ROWS))
        self._go_on(path, program.nominal)

    @classmethod
    def resume(cls, path: Path, program: Program, *, seed: int, samples: int, keep: str, surfaces: int) -> "ArchiveWriter":
        """Open an archive to go on after its last checkpoint, up to `samples`, or to its own number if that is larger.

        Raises ArchiveError where the file is no archive, or holds another model or another run.
        """
        inspect(path)
        writer = cls.__new__(cls)
        with _replacing(path) as part:
            # Only the copy is opened: whoever reads the old file in this process may go on, HDF5 bears no file opened twice.
            shutil.copyfile(path, part)
            with opened(part) as results:
                check_rows(results)
            with _opened(part, "r+") as file:
                check_same_run(file, path, program, run_settings(program, seed, samples, keep), surfaces)
                _sums(file, path, program.nominal)
                samples, length = max(samples, int(file.samples)), len(file.dimensions[words.REALIZATION])
                check_room(path, program.nominal, kept_rows(keep), samples - length)
                lay_out_rows(file, length, samples)
                file.setncattr("samples", np.int64(samples))
                rows = max(0, int(file[words.SUMMED_ROWS.name][:].max()))
                others = "" if file.versions == versions() else f" with {versions()}"
                file.setncattr("history", f"{file.history}\n{now()} resumed after {rows} realizations{others}")
                # What follows stands for the rows of before.
                nothing = {_field(part): no_field(len(part.vertices)) for part in program.nominal.parts}
                overwrite(file, {"surface": nothing_checked(surfaces, len(program.nominal.pairs)), **nothing})
        writer._go_on(path, program.nominal)
        return writer

    def _go_on(self, path: Path, nominal: Nominal) -> None:
        """Open the file and take up the sums of its last checkpoint."""
        with _refusals_told(path):
            self._path, self._file = path, _opened(path, "r+")
        self._nominal = nominal
        self._rows_kept = [variable for variable in words.BY_REALIZATION if self._stored(variable) is not None]
        self._fields_written = time.monotonic()
        self.samples, self.block_rows = int(self._file.samples), int(self._file.block_rows)
        self._take_up_sums()

    def _take_up_sums(self) -> None:
        """Go back to the last checkpoint."""
        self._moments = [_of_states(self._nominal, part) for part in self._nominal.parts]
        self.rows, self._slot, sums = _sums(self._file, self._path, self._nominal)
        for of_part, both in zip(sums, self._moments, strict=False):
            for state, moments in enumerate(both):
                moments.state = of_part[state]

    def _stored(self, variable: words.Variable) -> netCDF4.Variable | None:
        group = self._file["sample"] if variable is words.DEVIATION else self._file
        return group.variables.get(variable.name)

    def __enter__(self) -> "ArchiveWriter":
        return self

    def __exit__(self, *error: object) -> None:
        with _refusals_told(self._path):
            self._file.close()

    def append(self, block: Block) -> None:
        """Write the rows of a block, and hand them over to the system."""
        with _refusals_told(self._path):
            if block.start + len(block) > len(self._file.dimensions[words.REALIZATION]):
                self._make_room_for_all()
            self._append(block)

    def _make_room_for_all(self) -> None:
        self._file.close()
        try:
            with _replacing(self._path) as part:
                shutil.copyfile(self._path, part)
                with _opened(part, "r+") as file:
                    lay_out_rows(file, len(file.dimensions[words.REALIZATION]), self.samples)
        finally:  # a run may be stopped here, and still writes its fields
            self._file = _opened(self._path, "r+")

    def _append(self, block: Block) -> None:
        rows = slice(block.start, block.start + len(block))
        R, t = block.poses[..., :9].reshape(*block.poses.shape[:3], 3, 3), block.poses[..., 9:]
        self._add_to_fields(R, t)
        values: dict[words.Variable, Any] = {
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
            words.DEVIATION: block.deviations,
            words.STATUS: block.status,
        }
        # As they will be stored: once, for the file and for the checksum.
        values = {variable: np.ascontiguousarray(values[variable], dtype=variable.kind) for variable in self._rows_kept}
        for variable, data in values.items():
            stored = self._stored(variable)
            if data.size and variable is not words.STATUS and stored is not None:
                stored[rows] = data
        checksums = [crc32(variable, data) for variable, data in values.items()]
        self._file[words.ROW_CHECKSUM.name][block.start // self.block_rows] = checksums
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
            if time.monotonic() - self._fields_written > FIELDS_EVERY:
                self._write_fields()

    def _check_point(self) -> None:
        self._slot = 1 - self._slot
        self._file[words.SUMMED_ROWS.name][self._slot] = words.UNFINISHED
        self._file.sync()
        for part, both in zip(self._nominal.parts, self._moments, strict=True):
            group, sums = self._file[_field(part)], np.array([moments.state for moments in both])
            group[words.FIELD_SUMS.name][self._slot] = sums
            group[words.SUMS_CHECKSUM.name][self._slot] = crc32(words.FIELD_SUMS, sums)
        self._file.sync()
        self._file[words.SUMMED_ROWS.name][self._slot] = self.rows
        self._file.sync()

    def write_fields(self) -> None:
        """Displacement fields of all parts, from the sums over all rows so far."""
        with _refusals_told(self._path):
            self._write_fields()

    def write_fields_of_checkpoint(self) -> None:
        """Displacement fields up to the last checkpoint: for a run that is stopped, at whatever instant."""
        with _refusals_told(self._path):
            self._take_up_sums()
            if self.rows:
                self._write_fields()

    def _write_fields(self) -> None:
        fields = {
            _field(part): {
                words.FIELD_MEAN: [moments.mean() for moments in both],
                words.FIELD_SIX_SIGMA: [moments.six_sigma() for moments in both],
                words.FIELD_INTERVAL: [moments.magnitude_bounds() for moments in both],
                words.FIELD_REALIZATIONS: self.rows,
            }
            for part, both in zip(self._nominal.parts, self._moments, strict=True)
        }
        overwrite(self._file, fields)
        self._fields_written = time.monotonic()

    def chosen(self, seed: int) -> np.ndarray:
        """Numbers (row,) of the realizations that are to be checked against the surfaces."""
        return choose(self._file, len(self._file["surface"].dimensions[words.CHECKED]), seed)

    def poses(self, rows: np.ndarray) -> np.ndarray | None:
        """Corrected poses (row, part, 12) of some rows; None where they are not kept."""
        return archived_poses(self._file, rows)

    def write_checked(self, rows: np.ndarray, penetration: np.ndarray, beside: np.ndarray) -> None:
        """What the check of some rows found, (row, pair) [mm]."""
        group = self._file["surface"]
        values = nothing_checked(len(group.dimensions[words.CHECKED]), len(self._nominal.pairs))
        found = {words.CHECKED_REALIZATION: rows, words.SURFACE_PENETRATION: penetration, words.BESIDE: beside}
        for variable, of_rows in found.items():
            values[variable][: len(rows)] = of_rows
        with _refusals_told(self._path):
            overwrite(self._file, {"surface": values})


def _sums(file: netCDF4.Dataset, path: Path, nominal: Nominal) -> tuple[int, int, list[np.ndarray]]:
    """Rows of the last checkpoint, its place, and its sums (state, number) of each part; none where nothing is summed up."""
    summed = np.ma.getdata(file[words.SUMMED_ROWS.name][:])
    slot = int(summed.argmax())
    rows, found = max(0, int(summed[slot])), []
    for part in nominal.parts if rows else ():
        group = file[_field(part)]
        found.append(np.ma.getdata(group[words.FIELD_SUMS.name][slot]))
        if crc32(words.FIELD_SUMS, found[-1]) != int(group[words.SUMS_CHECKSUM.name][slot]):
            raise ArchiveError(
                f'archive "{path}" is damaged: the sums of the field of part "{part.name}" are not what was written; write to '
                "a new file"
            )
    return rows, slot, found


def _field(part: NominalPart) -> str:
    """The path of a part's field."""
    return f"field/{words.group_of(part.name)}"


def _of_states(nominal: Nominal, part: NominalPart) -> list[FieldMoments]:
    """Sums of the raw and of the corrected field, which are one where contact cannot move the part."""
    raw = FieldMoments(part.vertices)
    return [raw, FieldMoments(part.vertices) if movers(nominal.assembly, part.part) else raw]


@contextlib.contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """A name beside `path` to write under; what was written takes the place of `path` when it is whole."""
    part = path.with_name(f".{path.name}.part")
    try:
        with _refusals_told(path):
            yield part
            part.replace(path)
    finally:
        part.unlink(missing_ok=True)


@contextlib.contextmanager
def _refusals_told(path: Path) -> Iterator[None]:
    """What the system or the netCDF library refuses (a full disk, say) as an ArchiveError."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or f"{error} (is the disk full?)"
        raise ArchiveError(f'archive "{path}" cannot be written: {reason}') from error


def _opened(path: Path, mode: Literal["w", "r+"]) -> netCDF4.Dataset:
    return netCDF4.Dataset(path, mode, format="NETCDF4")
