"""Work on files of unknown origin in a process of its own: whatever such a file does to a library, it ends there."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

try:
    import resource
except ImportError:  # not on Windows, where memory is not limited
    resource = None  # type: ignore[assignment]


class ChildDiedError(Exception):
    """The process did not finish; the message states why."""


def run_child(script: Path, *arguments: str, seconds: float) -> str:
    """Standard output of a Python file, which should begin with `limit_memory`.

    Raises ChildDiedError if it takes too long, or ends by a signal or an error.
    """
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(folder or str(Path.cwd()) for folder in sys.path),
        "PYTHONIOENCODING": "utf-8:surrogateescape",
        "OPENBLAS_NUM_THREADS": "1",
    }
    try:
        ended = subprocess.run(
            [sys.executable, "-P", os.fspath(script), *arguments],
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise ChildDiedError(f"reading it took longer than {seconds:.0f} s") from error
    if ended.returncode:
        raise ChildDiedError(_how(ended))
    return ended.stdout.decode("utf-8", "surrogateescape")


def limit_memory(size: int) -> None:
    """Let this process have `size` bytes of memory at most, and leave no core behind."""
    if resource is not None:
        for limit, value in ((resource.RLIMIT_AS, size), (resource.RLIMIT_CORE, 0)):
            with contextlib.suppress(ValueError):  # a lower limit holds already
                resource.setrlimit(limit, (value, value))


def _how(ended: subprocess.CompletedProcess) -> str:
    if ended.returncode < 0:
        return f"the library that reads it crashed (signal {-ended.returncode})"
    last = (ended.stderr.decode("utf-8", "replace").strip().splitlines() or ["no message"])[-1]
    if last.startswith("MemoryError"):
        return "reading it takes too much memory"
    return f"the library that reads it failed ({last})"
