"""Folders of results that nobody named: removed at the end, or by a later run if their own was killed."""

import contextlib
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

PREFIX = "tolcontact-run-"
LOCK = ".lock"
MIN_AGE = 60.0  # s: a run may still be about to lock a younger folder


@contextlib.contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a new folder that is locked as long as it is used, and remove those whose runs were killed."""
    remove_abandoned_folders()
    with tempfile.TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True) as name, FileLock(Path(name) / LOCK):
        yield Path(name)


def remove_abandoned_folders() -> None:
    """Remove folders of killed runs. The system has released their locks; locks of other users cannot be opened."""
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError, Timeout):
            if not folder.is_symlink() and time.time() - folder.stat().st_mtime > MIN_AGE:
                with FileLock(folder / LOCK, timeout=0):
                    pass
                shutil.rmtree(folder)
