"""The cache of machine code on disk, for later processes that evaluate the same Functions. It only saves time.

Each file in the user's cache folder has a checksum, since LLVM would crash on damaged code.
"""

import contextlib
import hashlib
import os
import tempfile
from pathlib import Path

import platformdirs

MAX_BYTES = 1 << 28  # of the folder; the least recently used files are deleted
_DIGEST_BYTES = 32


def load(key: str) -> bytes | None:
    """Return the code stored under a key; None if it is missing or damaged."""
    path = cache_folder() / key
    try:
        data = path.read_bytes()
    except OSError:
        return None
    with contextlib.suppress(OSError):  # of another user's folder
        os.utime(path)
    code = data[_DIGEST_BYTES:]
    return code if hashlib.blake2b(code, digest_size=_DIGEST_BYTES).digest() == data[:_DIGEST_BYTES] else None


def store(key: str, code: bytes, max_bytes: int = MAX_BYTES) -> None:
    """Store code under a key, if the cache folder can be written."""
    with contextlib.suppress(OSError):
        folder = cache_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, delete=False) as file:
            file.write(hashlib.blake2b(code, digest_size=_DIGEST_BYTES).digest() + code)
        Path(file.name).replace(folder / key)  # at once: others see all of it or nothing
        _make_room(folder, max_bytes)


def cache_folder() -> Path:
    """Return the folder of the cache, which need not exist."""
    return platformdirs.user_cache_path("tolcontact", appauthor=False) / "code"


def _make_room(folder: Path, max_bytes: int) -> None:
    entries = [(path.stat(), path) for path in folder.iterdir()]
    size = sum(stat.st_size for stat, _ in entries)
    for stat, path in sorted(entries, key=lambda entry: entry[0].st_mtime):
        if size <= max_bytes:
            return
        with contextlib.suppress(FileNotFoundError):  # another process was faster
            path.unlink()
        size -= stat.st_size
