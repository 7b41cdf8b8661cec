"""Files that appear under their names only when they are complete."""

import contextlib
import glob
import secrets
from collections.abc import Iterator
from pathlib import Path

from tolcontact.system import files


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield the path of a new, empty file to write to, which then replaces `path`.

    It stands next to `path`, under a name that nobody can have given to a file or link before.
    Raises OSError if it cannot be made, or cannot replace `path`; then `path` stays as it is.
    """
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    files.make_new(part)
    try:
        yield part
        files.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def remove_abandoned(path: Path) -> None:
    """Remove the files that writers of `path` left when they were killed. Nobody may be writing it now."""
    for part in path.parent.glob(f".{glob.escape(path.name)}.{'[0-9a-f]' * 8}.part"):
        with contextlib.suppress(OSError):  # the file belongs to another user
            part.unlink()
