"""The cache of machine code on disk, for later processes that compile the same functions. It only saves time.

Whoever can write to the cache can run code as its reader. So it is used only if its folder belongs to this user, nobody else
can write to it or replace it, and a file in it only if it belongs to this user as well; otherwise all is compiled again. Each
file has a checksum, since LLVM would crash on damaged code.
"""

import contextlib
import grp
import hashlib
import os
import pwd
import stat
import tempfile
from pathlib import Path

import platformdirs

MAX_BYTES = 1 << 28  # of the folder; the least recently used files are deleted
_DIGEST_BYTES = 32
_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def load(key: str) -> bytes | None:
    """Return the code stored under a key; None if it is missing, damaged, or could be somebody else's."""
    path = cache_folder() / key
    with contextlib.suppress(OSError):
        if not is_private(path.parent):
            return None
        # A link is not followed, and a pipe not waited for.
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
            if not _is_own(status := os.fstat(file.fileno())) or not stat.S_ISREG(status.st_mode):
                return None
            data = file.read()
            with contextlib.suppress(OSError):  # of a file system that is read-only
                os.utime(file.fileno())
        code = data[_DIGEST_BYTES:]
        return code if hashlib.blake2b(code, digest_size=_DIGEST_BYTES).digest() == data[:_DIGEST_BYTES] else None
    return None


def store(key: str, code: bytes, max_bytes: int = MAX_BYTES) -> None:
    """Store code under a key, if there is a cache folder that only this user can write to, and make room for it."""
    with contextlib.suppress(OSError):
        if write(key, code):
            _make_room(cache_folder(), max_bytes)


def write(key: str, data: bytes) -> bool:
    """Store a few bytes without a look at the other files, which may take longer. Return whether they are stored."""
    with contextlib.suppress(OSError):
        folder = cache_folder()
        for each in (*reversed(folder.parents), folder):
            if not each.exists():
                each.mkdir(mode=0o700, exist_ok=True)
        if not is_private(folder):
            return False
        with tempfile.NamedTemporaryFile(dir=folder, delete=False) as file:
            try:
                file.write(hashlib.blake2b(data, digest_size=_DIGEST_BYTES).digest() + data)
                file.flush()
                Path(file.name).replace(folder / key)  # at once: others see all of it or nothing
            except BaseException:
                Path(file.name).unlink(missing_ok=True)
                raise
        return True
    return False


def cache_folder() -> Path:
    """Return the folder of the cache, which need not exist."""
    return platformdirs.user_cache_path("tolcontact", appauthor=False) / "code"


def is_private(folder: Path) -> bool:
    """Return whether a path is a folder, and no link, of this user, that no other user (but root) can write to or replace.

    Raises OSError if it does not exist.
    """
    status = folder.lstat()
    if not (stat.S_ISDIR(status.st_mode) and _is_own(status)):
        return False
    return all(_is_safe(parent.stat()) for parent in folder.parent.resolve().joinpath(folder.name).parents)


def _is_own(status: os.stat_result) -> bool:
    """Return whether a file or folder belongs to this user, and others cannot write to it."""
    return status.st_uid == os.geteuid() and not status.st_mode & _OTHERS


def _is_safe(status: os.stat_result) -> bool:
    """Return whether others cannot rename what is in a folder and belongs to this user."""
    if status.st_uid not in (0, os.geteuid()):
        return False
    writers = status.st_mode & _OTHERS
    return not writers or bool(status.st_mode & stat.S_ISVTX) or (writers == stat.S_IWGRP and _is_own_group(status.st_gid))


def _is_own_group(number: int) -> bool:
    """Return whether a group is the one that many systems make for each user, with nobody else in it."""
    try:
        group, name = grp.getgrgid(number), pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return False
    return group.gr_name == name and set(group.gr_mem) <= {name}


def _make_room(folder: Path, max_bytes: int) -> None:
    entries = [(path.lstat(), path) for path in folder.iterdir()]
    size = sum(status.st_size for status, _ in entries)
    for status, path in sorted(entries, key=lambda entry: entry[0].st_mtime):
        if size <= max_bytes:
            return
        with contextlib.suppress(FileNotFoundError):  # another process was faster
            path.unlink()
        size -= status.st_size
