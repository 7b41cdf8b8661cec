"""The cache of machine code on disk, for later processes that compile the same functions. It only saves time.

Whoever can write to the cache can run code as its reader. So it is used only if its folder belongs to this user, nobody else
can write to it or replace it, and a file in it only if it belongs to this user as well; otherwise all is compiled again. Each
file has a checksum, since LLVM would crash on damaged code.
"""

import contextlib
import hashlib
import os
import stat
import tempfile
from pathlib import Path

import numpy as np
import platformdirs

from tolcontact.system import files
from tolcontact.system.ownership import is_own, is_private

MAX_BYTES = 1 << 28  # of the folder; the least recently used files are deleted
_DIGEST_BYTES = 32


def load(key: str) -> bytes | None:
    """Return the code stored under a key; None if it is missing, damaged, or could be somebody else's."""
    path = cache_folder() / key
    with contextlib.suppress(OSError):
        if not is_private(path.parent):
            return None
        with files.open_unlinked(path) as file:
            if not is_own(status := os.fstat(file.fileno())) or not stat.S_ISREG(status.st_mode):
                return None
            data = file.read()
            with contextlib.suppress(OSError):  # of a file system that is read-only
                files.mark_used(file, path)
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
        file = tempfile.NamedTemporaryFile(dir=folder, delete=False)  # noqa: SIM115  (closed before it is moved)
        try:
            with file:
                file.write(hashlib.blake2b(data, digest_size=_DIGEST_BYTES).digest() + data)
            files.replace(Path(file.name), folder / key)  # at once: others see all of it or nothing
        except BaseException:
            Path(file.name).unlink(missing_ok=True)
            raise
        return True
    return False


def digest(*contents: np.ndarray | bytes) -> str:
    """Return a digest of arrays and bytes."""
    pieces = (content.tobytes() if isinstance(content, np.ndarray) else content for content in contents)
    return hashlib.blake2b(b"".join(hashlib.blake2b(piece).digest() for piece in pieces), digest_size=16).hexdigest()


def cache_folder() -> Path:
    """Return the folder of the cache, which need not exist."""
    return platformdirs.user_cache_path("tolcontact", appauthor=False) / "code"


def _make_room(folder: Path, max_bytes: int) -> None:
    entries = [(path.lstat(), path) for path in folder.iterdir()]
    size = sum(status.st_size for status, _ in entries)
    for status, path in sorted(entries, key=lambda entry: entry[0].st_mtime):
        if size <= max_bytes:
            return
        with contextlib.suppress(FileNotFoundError):  # another process was faster
            path.unlink()
        size -= status.st_size
