"""Files that a command or a model names: regular files of a bounded size, so that no device or pipe is read without end."""

import sys
from collections.abc import Iterable
from pathlib import Path

MAX_BYTES = 1 << 30


def fault_of(path: Path, max_bytes: int = sys.maxsize) -> str:
    """Return what is wrong with an input, in words that follow its name; empty for a regular file of at most `max_bytes`."""
    try:
        if not path.exists():
            return "does not exist"
        if not path.is_file():
            return "is a folder, a device or a pipe; expected a regular file"
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        return f"cannot be opened ({getattr(error, 'strerror', None) or 'its name cannot be used'})"
    return f"has {size} bytes; expected at most {max_bytes}" if size > max_bytes else ""


def is_archive(path: str | Path) -> bool:
    """Return whether a path has the extension of an archive."""
    return Path(path).suffix.lower() == ".nc"


def check_inputs(paths: Iterable[Path], max_bytes: int = MAX_BYTES) -> None:
    """Raise ValueError unless all paths are regular files, of at most `max_bytes` together."""
    total = 0
    for path in paths:
        if fault := fault_of(path):
            raise ValueError(f'"{path}" {fault}')
        total += path.stat().st_size
    if total > max_bytes:
        raise ValueError(f"{total} bytes are to be read; expected at most {max_bytes}")
