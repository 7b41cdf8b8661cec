"""Taking a name: of all runs on a machine, one writes an archive."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from tolcontact.archive.inspection import check_name
from tolcontact.errors import ArchiveError, OptionError


@contextlib.contextmanager
def taken(path: str | Path, *, overwrite: bool = False, resume: bool = False) -> Iterator[Path]:
    """The file that `path` stands for (the target, if it is a link), kept from all other runs meanwhile.

    A run that was killed holds nothing: the system releases what it had taken.
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
        if real.exists():
            _check_replaceable(path, real, asked=overwrite or resume)
        yield real
    finally:
        # Also whoever was stopped between making the file and locking it leaves none behind, unless it is another run's.
        with contextlib.suppress(OSError):
            holding.acquire()
            lock.unlink(missing_ok=True)  # whoever opened it meanwhile finds that it is gone, and tries again
            holding.release(force=True)


def _acquire(holding: FileLock, lock: Path, path: str | Path) -> None:
    try:
        lock.touch()  # fails with a reason if it cannot be made
        holding.acquire()
    except Timeout as error:
        raise ArchiveError(f'archive "{path}" is being written by another run; wait, or write to a new file') from error
    except OSError as error:
        raise ArchiveError(f'archive "{path}" cannot be written: {error.strerror}') from error


def _check_replaceable(path: str | Path, real: Path, *, asked: bool) -> None:
    if not asked:
        raise ArchiveError(f'archive "{path}" exists; choose another name, or ask to overwrite or to resume it')
    if not os.access(real, os.W_OK):
        raise ArchiveError(f'archive "{path}" cannot be written: it is read-only')
