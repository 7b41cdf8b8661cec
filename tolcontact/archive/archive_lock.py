"""The lock of an archive: only one run on a machine writes it."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from tolcontact.archive.inspection import check_name
from tolcontact.errors import ArchiveError, OptionError
from tolcontact.replacing import remove_abandoned
from tolcontact.system import files

LONGEST_SUFFIX = f".checkpoint.{'0' * 8}.part"  # of the working files of a run


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
    if not real.parent.is_dir():
        raise ArchiveError(f'archive "{path}" cannot be written: folder "{real.parent}" does not exist; create it first')
    if real.exists() and not real.is_file():
        raise ArchiveError(f'archive "{path}" cannot be written: it is not a file')
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


def _is_netcdf(path: Path) -> bool:
    """Return whether a file begins as netCDF files do, or is empty."""
    with path.open("rb") as file:
        return file.read(8).startswith((b"\x89HDF\r\n\x1a\n", b"CDF\1", b"CDF\2", b"CDF\5")) or not path.stat().st_size


def _check_replaceable(path: str | Path, real: Path, *, is_allowed: bool) -> None:
    if not is_allowed:
        raise ArchiveError(
            f'archive "{path}" exists; choose another name, replace it (--overwrite, overwrite=True) or continue it '
            "(--resume, resume=True)"
        )
    if not _is_netcdf(real):
        raise ArchiveError(f'"{path}" is no netCDF file, and only these are replaced; choose another name, or remove it first')
    if not os.access(real, os.W_OK):
        raise ArchiveError(f'archive "{path}" cannot be written: it is read-only')
