"""The process that reads shape files (see geometry.files.reader). A command may start it before the files are known.

To load the CAD kernel takes as long as the imports of a small run. Started early, it happens meanwhile.
"""

import contextlib
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tolcontact.child import environment

PROGRAM = Path(__file__).parent / "geometry" / "files" / "worker.py"
STEP_FILE = re.compile(r"\.ste?p$", re.IGNORECASE)
QUOTED_STEP_FILE = re.compile(r"\.ste?p[\"']", re.IGNORECASE)  # in a script, or a model in JSON
_early: list[subprocess.Popen] = []  # at most one, which nobody has taken


def start_early(arguments: Iterable[str]) -> subprocess.Popen | None:
    """Start and return a process that loads the CAD kernel, if an argument of a command is a STEP file or names one.

    An argument that is a model names a STEP file if its text does. None is returned if no process is started.
    """
    if _early or not any(map(_needs_kernel, arguments)):
        return None
    with contextlib.suppress(OSError):  # it is started again when it is needed
        _early.append(_start([], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        return _early[0]
    return None


def _needs_kernel(argument: str) -> bool:
    path = Path(argument)
    try:
        if STEP_FILE.search(argument):
            return path.is_file()
        is_model = path.suffix.lower() in (".py", ".json")
        return is_model and bool(QUOTED_STEP_FILE.search(path.read_text(encoding="utf-8", errors="ignore")))
    except (OSError, ValueError):  # not a file
        return False


def started(folder: Path) -> subprocess.Popen:
    """Return the process that works through the list in a folder: the one that was started early, or a new one.

    Raises OSError if it cannot be started.
    """
    with contextlib.suppress(IndexError, OSError):
        process = _early.pop()
        if process.poll() is None:
            assert process.stdin is not None
            with process.stdin as stream:
                stream.write(os.fsencode(folder) + b"\n")
            return process
    with (folder / "errors").open("wb") as errors:
        return _start([os.fspath(folder)], stdin=subprocess.DEVNULL, stdout=errors, stderr=errors)


def end_unused() -> None:
    """End the process that was started early, if no file was read."""
    while _early:
        process = _early.pop()
        process.kill()
        process.communicate()


def _start(arguments: list[str], **streams: Any) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-P", os.fspath(PROGRAM), *arguments],
        # The memory that is set aside for idle threads would count against the limit.
        env={**environment(), "MALLOC_ARENA_MAX": "4"},
        **streams,
    )
