"""Files that a model names: regular files of a bounded size, so that no device or pipe is read without end."""

from collections.abc import Iterable
from pathlib import Path

MAX_BYTES = 1 << 30


def check_inputs(paths: Iterable[Path], max_bytes: int = MAX_BYTES) -> None:
    """Raise ValueError unless all paths are regular files, of at most `max_bytes` together; OSError if one is missing."""
    total = 0
    for path in paths:
        status = path.stat()
        if not path.is_file():
            raise ValueError(f'"{path}" is a folder, a device or a pipe; expected a regular file')
        total += status.st_size
    if total > max_bytes:
        raise ValueError(f"{total} bytes are to be read; expected at most {max_bytes}")
