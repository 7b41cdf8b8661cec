"""Files: opened without following links, replaced while others may have them open, removed while they are locked."""

import errno
import os
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import lazy_loader

ctypes = lazy_loader.load("ctypes")  # on Windows
IS_POSIX = hasattr(os, "geteuid")  # users with numbers, links for everyone, open files that can be replaced and removed
# A link is not followed, and a pipe not waited for. Windows has neither flag, but it changes line ends unless told not to.
_FLAGS = sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"))
_NO_FILE = 2  # the code of Windows for a file that does not exist
_RETRY_SECONDS = (0.05, 0.1, 0.2, 0.4)  # a virus scanner or an indexer holds a new file open for a moment
IN_USE = "it is open in another program, or as results in this one (results.close()); close it there, and try again"

MAX_LENGTH = 259  # letters of a path that all programs on Windows take
NOT_PLAIN = f"netCDF opens paths of {MAX_LENGTH} ASCII letters at most, and this drive has no short names; choose another path"
TOO_LONG = f"Windows takes paths of {MAX_LENGTH} letters at most, with the endings of working files; choose a shorter path"


class FileInUseError(PermissionError):
    """Another program holds open a file that should be replaced; `strerror` says what to close."""


def open_unlinked(path: Path) -> BinaryIO:
    """Open a file, and no link, for reading; it may be a pipe or a device."""
    _refuse_link(path)
    return os.fdopen(os.open(path, os.O_RDONLY | _FLAGS), "rb")


def make_new(path: Path) -> None:
    """Make an empty file. Raises FileExistsError if there is one, or a link."""
    check_length(path)
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | _FLAGS, 0o666))


def make_writable(path: Path) -> None:
    """Make an empty file unless there is one that can be written to. Raises OSError if that cannot be done, or for a link."""
    _refuse_link(path)
    os.close(os.open(path, os.O_CREAT | os.O_RDWR | _FLAGS, 0o666))


def check_length(path: Path) -> None:
    """Raise OSError if a path in an existing folder is too long for Windows, unless its user allows long paths."""
    if IS_POSIX or len(str(path.absolute())) <= MAX_LENGTH or not path.parent.is_dir():
        return
    try:
        path.lstat()
    except OSError as error:
        if getattr(error, "winerror", None) != _NO_FILE:
            raise OSError(errno.ENAMETOOLONG, TOO_LONG, str(path)) from error


def plain_path(path: Path) -> str:
    """Return the path of an existing file for libraries that, on Windows, take only short paths of ASCII letters.

    There it is the short path (`JRGEN~1`) of a file that has another one. Raises OSError if its drive keeps no short names.
    """
    if IS_POSIX or _is_plain(text := str(path.absolute())):
        return os.fspath(path)
    short = ctypes.create_unicode_buffer(1 << 15)
    name = text if len(text) <= MAX_LENGTH else rf"\\?\{text}"
    ctypes.windll.kernel32.GetShortPathNameW(name, short, len(short))
    plain = short.value.removeprefix("\\\\?\\")
    if not (plain and _is_plain(plain)):
        raise OSError(errno.EINVAL, NOT_PLAIN, str(path))
    return plain


def mark_used(file: BinaryIO, path: Path) -> None:
    """Set the time of the last change of an open file to now."""
    os.utime(file.fileno() if os.utime in os.supports_fd else path)


def replace(source: Path, target: Path) -> None:
    """Move a file to the name of another one, which it replaces.

    On Windows that fails while any program has one of them open. It is tried five times, and then raises FileInUseError.
    """
    _try_again(lambda: source.replace(target), target)


def remove(path: Path) -> None:
    """Remove a file, if there is one. On Windows it is tried five times, and then raises FileInUseError."""
    _try_again(lambda: path.unlink(missing_ok=True), path)


def remove_held(path: Path, release: Callable[[], object]) -> None:
    """Remove a file that this process holds open and locked, and release it.

    On Windows, no open file can be removed: it is released first, and stays if another process has opened it meanwhile.
    """
    if IS_POSIX:
        path.unlink(missing_ok=True)
        release()
    else:
        release()
        path.unlink(missing_ok=True)


def is_link(status: os.stat_result) -> bool:
    """Return whether the status from `lstat` belongs to a link, or of a junction of Windows."""
    junction = getattr(stat, "IO_REPARSE_TAG_MOUNT_POINT", None)
    return stat.S_ISLNK(status.st_mode) or (junction is not None and getattr(status, "st_reparse_tag", None) == junction)


def _is_plain(text: str) -> bool:
    return text.isascii() and len(text) <= MAX_LENGTH


def _try_again(change: Callable[[], object], path: Path) -> None:
    """Change a file, on Windows again while it is open in another program. Folders and read-only files fail at once."""
    for seconds in (*_RETRY_SECONDS, None):
        try:
            change()
        except PermissionError as error:
            if IS_POSIX or path.is_dir() or (path.exists() and not os.access(path, os.W_OK)):
                raise
            if seconds is None:
                raise FileInUseError(errno.EACCES, IN_USE, str(path)) from error
            time.sleep(seconds)
        else:
            return


def _refuse_link(path: Path) -> None:
    """Raise OSError for a link, where opening it cannot."""
    if not hasattr(os, "O_NOFOLLOW") and os.path.lexists(path) and is_link(path.lstat()):
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
