"""Writing an archive: its header first, its realizations block by block to a journal, and all of them at the end."""

import contextlib
import os
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import netCDF4
import numpy as np

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.archive.header import empty_checks, write_header
from tolcontact.archive.inspection import check_archive, check_ending, inspect
from tolcontact.archive.journal import Checkpoint, Journal, locked_archive
from tolcontact.archive.netcdf_files import open_netcdf
from tolcontact.archive.reader import check_rows, open_unchecked
from tolcontact.archive.rows import check_room, kept_rows
from tolcontact.archive.same_model import check_same_model, check_same_run
from tolcontact.archive.settings import Run, now, run_settings, versions
from tolcontact.archive.variables import overwrite
from tolcontact.compilation import Program
from tolcontact.errors import ArchiveError
from tolcontact.replacing import replacing
from tolcontact.system import files

if TYPE_CHECKING:
    import xarray as xr


class ArchiveWriter:
    """An archive being written, whose file is locked (see `locked_archive`).

    rows      number of realizations in the archive and its journal; the next block starts there
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
            self._start(file, path, program, run)
        self._journal.remove()

    @classmethod
    def resume(cls, path: Path, program: Program, run: Run) -> "ArchiveWriter":
        """Open an archive to continue after its last checkpoint, up to the run's samples, or its own number if larger.

        Raises ArchiveError if the file is not an archive, or contains another model or another run.
        """
        inspect(path)
        with open_netcdf(path, "r") as file:
            check_same_run(file, path, program, run_settings(program, run), run.surfaces)
            software = "" if file.versions == versions() else f" with {versions()}"
            writer = cls.__new__(cls)
            writer._start(file, path, program, run)
        with open_unchecked(path) as results:
            check_rows(results)
        writer._take_journal()
        check_room(path, program.nominal, writer.kept, writer.samples - writer.rows)
        writer._resumed = f"\n{now()} resumed after {writer.rows} realizations{software}"
        return writer

    def _start(self, file: netCDF4.Dataset, path: Path, program: Program, run: Run) -> None:
        self._path = self._current = path
        self._parts, self._pairs = [part.name for part in program.nominal.last_parts], len(program.nominal.pairs)
        self._stations, self._checked = [scene.station for scene in program.nominal.scenes], run.surfaces
        self._checkpoint_interval, self._since, self._resumed = run.checkpoint_interval, time.monotonic(), ""
        rows = kept_rows(program.nominal, run.keep)  # an earlier version wrote fewer
        self.kept = tuple(row for row in rows if row.variable.name in (file[row.group] if row.group else file).variables)
        self.rows = self._start_row = int(file[terms.SUMMED_ROWS.name][...])
        self.samples, self._block_rows = max(run.samples, int(file.samples)), int(file.block_rows)
        sums = [file[terms.field_of(part)][terms.FIELD_SUMS.name][...] for part in self._parts]
        self._checkpoint = Checkpoint(file.history, self.rows, 0, 0, self.samples, sums if self.rows else [])
        self._journal = Journal(path, self.kept, self._block_rows)

    def _take_journal(self) -> None:
        """Put the journal of a killed run into the archive, up to its last checkpoint."""
        checkpoint = self._journal.checkpoint(self._checkpoint.archive)
        if checkpoint and checkpoint.rows > self.rows:
            self.rows, self.samples = checkpoint.rows, max(self.samples, checkpoint.samples)
            self._checkpoint = checkpoint
            with self.completed({}):
                pass
            self._start_row = self.rows
        self._journal.remove()

    @property
    def sums(self) -> list[np.ndarray]:
        """The sums of fields at the last checkpoint, (state, number) for each part; empty without one."""
        return self._checkpoint.sums

    def append(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Write the rows of a block to the journal; `arrays` have the labels of `kept`."""
        with _as_archive_error(self._path):
            self._journal.append(arrays[row.label] for row in self.kept)
        self.rows += len(arrays[terms.STATUS.name])

    @property
    def has_new_rows(self) -> bool:
        """True if the journal holds realizations that the archive does not hold."""
        return self._journal.size > 0

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
        self._checkpoint = self._checkpoint._replace(
            rows=self.rows,
            size=self._journal.size,
            checksum=self._journal.checksum,
            samples=self.samples,
            sums=[array.copy() for array in sums],
        )
        with _as_archive_error(self._path):
            self._journal.write_checkpoint(self._checkpoint)
        self._since = time.monotonic()

    @contextlib.contextmanager
    def completed(self, groups: Mapping[str, Mapping[terms.ArchiveVariable, Any]]) -> Iterator[None]:
        """Replace the archive by one with all rows, with the last checkpoint, and with the values of `groups`.

        Until it does so at the end of the block, `rows_to_check` and `write_checked` refer to the new archive.
        """
        with contextlib.ExitStack() as stack:
            with _as_archive_error(self._path):
                part = stack.enter_context(replacing(self._path))
                shutil.copyfile(self._path, part)
                with open_netcdf(part, "r+") as file:
                    self._journal.put_into(file, self._start_row, self.rows)
                    overwrite(file, "", {terms.SUMMED_ROWS: self._checkpoint.rows})
                    for name, sums in zip(self._parts, self._checkpoint.sums, strict=self._checkpoint.rows > 0):
                        overwrite(file, terms.field_of(name), {terms.FIELD_SUMS: sums})
                    checks = empty_checks(self._checked, self._pairs)  # an earlier check was of the earlier rows
                    for group, values in ({"surface": checks} | dict(groups)).items():
                        overwrite(file, group, values)
                    numbers = {"samples": np.int64(self.samples), "realizations": np.int64(self.rows)}
                    file.setncatts({**numbers, "history": f"{file.history}{self._resumed}"})
            self._current = part
            try:
                yield
            finally:
                self._current = self._path
            with _as_archive_error(self._path):
                stack.close()
        self._journal.remove()

    def rows_to_check(self, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Return the numbers (row,) of the realizations to check against the surfaces, and whether each is a random choice.

        With their corrected poses (row, part, 12), or None if they are not kept.
        """
        with open_netcdf(self._current, "r") as file:
            rows, at_random = choose(file, self._checked, seed)
            return rows, at_random, _archived_poses(file, rows, self._stations) if rows.size else None

    def first_poses(self, end: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers (row,) of the first rows, before `end`, that are not `searched`, and their corrected poses.

        poses   (row, part, 12), which the archive has to keep
        """
        with open_netcdf(self._path, "r") as file:
            rows = np.flatnonzero(file[terms.SEARCHED.name][:end] == 0)
            poses = _archived_poses(file, rows, self._stations)
        assert poses is not None
        return rows, poses

    def write_checked(self, rows: np.ndarray, at_random: np.ndarray, findings: Iterable[np.ndarray]) -> None:
        """Write the findings (row, pair) of the check of some rows, in the order of SURFACE in the vocabulary."""
        values = empty_checks(self._checked, self._pairs)
        for variable, array in zip(terms.SURFACE, (rows, *findings, at_random), strict=True):
            values[variable][: len(rows)] = array
        self.write_group("surface", values)

    def first_outcomes(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the corrected measures (row, measure) and the statuses (row,) of the first rows."""
        with open_netcdf(self._current, "r") as file:
            return file[terms.MEASURED.name][:count, terms.CORRECTED], file[terms.STATUS.name][:count]

    def has_objectives(self) -> bool:
        """Return whether the archive holds, or has no room for, results under other objectives."""
        with open_netcdf(self._current, "r") as file:
            group = file.groups.get(terms.OBJECTIVES_GROUP)
            return group is None or bool((group[terms.STATUS_BY_OBJECTIVE.name][0] >= 0).all())

    def write_group(self, group: str, values: Mapping[terms.ArchiveVariable, Any]) -> None:
        """Write the values of variables in a group."""
        with _as_archive_error(self._path), open_netcdf(self._current, "r+") as file:
            overwrite(file, group, values)


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


def check_room_for(path: str | Path, record: terms.AnalysisRecord, program: Program, realizations: int) -> None:
    """Raise ArchiveError unless an archive is of the program's model and takes an answer of so many realizations.

    It takes none if it holds a complete one of this analysis, unless that one grows and is of fewer realizations.
    """
    check_ending(path)
    archive = Path(os.path.realpath(path))
    check_archive(archive)
    with open_netcdf(archive, "r") as file:
        check_same_model(file, archive, program)
        stored = _stored_analysis(file, record)
        if stored is None or terms.COARSE in stored.ncattrs():
            return
        count, remedy = getattr(stored, "realizations", None), ""
        if record.grows and isinstance(count, np.integer):
            if count < realizations:
                return
            remedy = f", or more samples than its {count}"
        group = f"{terms.ANALYSES_GROUP}/{record.name}"
        raise ArchiveError(f'"{path}" already has {group}, which is not replaced; choose another archive{remedy}')


def _stored_analysis(file: netCDF4.Dataset, record: terms.AnalysisRecord) -> netCDF4.Group | None:
    analyses = file.groups.get(terms.ANALYSES_GROUP)
    return None if analyses is None else analyses.groups.get(record.name)


def keep(path: str | Path, record: terms.AnalysisRecord, dataset: "xr.Dataset", program: Program) -> None:
    """Add an analysis to an archive of the same model (see `check_room_for`).

    The file is replaced only when all of the new one is written.
    """
    with locked_archive(path, resume=True) as archive:
        check_room_for(path, record, program, int(dataset.attrs.get("realizations", 0)))
        with replacing_archive(archive) as part:
            shutil.copyfile(archive, part)
            stored = dataset.copy()
            for array in stored.variables.values():
                array.encoding = {"fletcher32": True} | ({"dtype": "S1"} if array.dtype.kind in "UO" else {})
            with open_netcdf(part, "r+") as file:
                replaced = _stored_analysis(file, record)
                if replaced is not None and terms.COARSE in replaced.ncattrs():  # a complete answer replaces it
                    replaced.delncattr(terms.COARSE)
            group = f"{terms.ANALYSES_GROUP}/{record.name}"
            try:
                stored.to_netcdf(files.plain_path(part), mode="a", group=group, engine="netcdf4")
            except ValueError as error:  # other groups, events, ...
                raise ArchiveError(f'"{path}" has a coarse {group} of other options; choose another archive') from error


def choose(file: netCDF4.Dataset, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers (row,) of at most `count` certified realizations, in order, and whether each is a random choice.

    One third penetrate most at contact points, one third have the most points under load, and the rest are random: a fair
    sample of all certified realizations.
    """
    rows = len(file.dimensions[terms.REALIZATION]) if count else 0
    certified, depths, loads = _certified(file, rows)
    lots = np.random.default_rng([seed, rows]).random(len(certified))
    # Only what exceeds rounding is deeper than anything else.
    ranked = (np.where(depths > terms.ROUNDED, depths, 0.0), count // 3), (loads, count // 3), (lots, count)
    deepest, busiest, random = (certified[_largest(values, number)] for values, number in ranked)
    fair = random[: count - 2 * (count // 3)]
    numbers = np.array(list(dict.fromkeys([*fair, *deepest, *busiest, *random])), dtype=np.int64)
    chosen = np.sort(numbers[:count])
    left_out = np.flatnonzero(~np.isin(random, chosen))
    return chosen, np.isin(chosen, random[: left_out[0] if len(left_out) else None])


def _certified(file: netCDF4.Dataset, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the numbers (row,) of the certified realizations, their penetrations [mm], and their numbers of active points."""
    pieces = [(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0, dtype=np.int64))]
    for start in range(0, rows, terms.PIECE_ROWS):
        piece = slice(start, min(start + terms.PIECE_ROWS, rows))
        status, gaps, active = (
            np.ma.getdata(file[variable.name][piece]) for variable in (terms.STATUS, terms.GAP_MIN, terms.CARRYING)
        )
        places = np.flatnonzero(np.isin(status, terms.CERTIFIED))
        depths = -gaps[places, terms.CORRECTED].min(axis=1, initial=np.inf)
        pieces.append((start + places, depths, active[places].sum(axis=1)))
    numbers, depths, loads = map(np.concatenate, zip(*pieces, strict=True))
    return numbers, depths, loads


def _largest(values: np.ndarray, count: int) -> np.ndarray:
    """Return the places of the largest values (row,) above 0, the first of equals."""
    places = np.argsort(-values, kind="stable")[:count]
    return places[values[places] > 0]


def _archived_poses(file: netCDF4.Dataset, rows: np.ndarray, stations: Sequence[str]) -> np.ndarray | None:
    """Return corrected poses (row, part, 12) of some rows; None if the archive does not keep poses.

    With `stations`, the parts of all stations follow one another.
    """
    if terms.ROTATION.name not in file.variables:
        return None
    groups = [(file[terms.station_group(station)], terms.STATION_POSES) for station in stations] or [(file, terms.POSES)]
    poses = []
    for group, variables in groups:
        t, R = (_rows_of(group[variable.name], rows) for variable in variables)
        poses.append(pose.pose(R, t))
    return np.concatenate(poses, axis=1)


def _rows_of(stored: netCDF4.Variable, rows: np.ndarray) -> np.ndarray:
    """Return the values in the corrected state of some rows: one read takes as long for a row as for a block."""
    values = np.empty((len(rows), *stored.shape[2:]))
    blocks = rows // terms.BLOCK_ROWS
    for block in np.unique(blocks):
        chosen = np.flatnonzero(blocks == block)
        first, last = rows[chosen].min(), rows[chosen].max()
        values[chosen] = np.ma.getdata(stored[first : last + 1, terms.CORRECTED])[rows[chosen] - first]
    return values
