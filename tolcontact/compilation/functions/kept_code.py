"""Machine code of Functions on disk, for the next process that evaluates the same ones: a cache only saves time.

It lies in the user's cache folder, in files with checksums: LLVM would crash on what is left of a damaged one.
"""

import contextlib
import hashlib
import os
import tempfile
from pathlib import Path

import platformdirs

MOST = 1 << 28  # bytes of the folder: what was not used for longest goes first
_SUM = 32


def kept(key: str) -> bytes | None:
    """Return the code that was kept under a key; None if there is none, or not all of it."""
    path = _folder() / key
    try:
        data = path.read_bytes()
    except OSError:
        return None
    with contextlib.suppress(OSError):  # of another user's folder
        os.utime(path)
    code = data[_SUM:]
    return code if hashlib.blake2b(code, digest_size=_SUM).digest() == data[:_SUM] else None


def keep(key: str, code: bytes) -> None:
    """Keep code, if that can be done."""
    with contextlib.suppress(OSError):
        folder = _folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, delete=False) as file:
            file.write(hashlib.blake2b(code, digest_size=_SUM).digest() + code)
        Path(file.name).replace(folder / key)  # at once: others see all of it or nothing
        _make_room(folder)


def _folder() -> Path:
    return platformdirs.user_cache_path("tolcontact", appauthor=False) / "code"


def _make_room(folder: Path) -> None:
    entries = [(path.stat(), path) for path in folder.iterdir()]
    size = sum(stat.st_size for stat, _ in entries)
    for stat, path in sorted(entries, key=lambda entry: entry[0].st_mtime):
        if size <= MOST:
            return
        with contextlib.suppress(FileNotFoundError):  # another process was faster
            path.unlink()
        size -= stat.st_size
