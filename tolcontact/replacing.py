"""Files that appear under their names only when they are complete, and replace no input and no other output."""

import contextlib
import glob
import itertools
import secrets
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from tolcontact.errors import OptionError
from tolcontact.system import files


def check_identities(inputs: Iterable[object], outputs: Mapping[str, Path]) -> None:
    """Raise OptionError for an output, by its kind, that is an input or another output, by whatever name."""
    named = [("input", Path(path)) for path in inputs if isinstance(path, str | Path)]
    for (name, path), (output, target) in itertools.combinations([*named, *outputs.items()], 2):
        if output in outputs and _is_same(path, target):
            raise OptionError(f'"{target}" would be the {name} and the {output}; choose another name for the {output}')


def _is_same(path: Path, target: Path) -> bool:
    """Return whether two paths lead to one file; names that differ only in case do on some systems."""
    if path.exists() and target.exists():
        return path.samefile(target)
    return str(path.resolve()).casefold() == str(target.resolve()).casefold()


def folder_fault(path: Path) -> str:
    """Return why there is no folder for a file, with what to do; empty if there is one."""
    if path.parent.is_dir():
        return ""
    if path.parent.exists():
        return f'"{path.parent}" is not a folder; choose another place'
    return f'there is no folder "{path.parent}"; make it first'


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
