"""Child processes for files of unknown origin: a library may crash, stall or take too much memory there."""

import os
import subprocess
import sys
from pathlib import Path

from tolcontact.system.exit_codes import TIME_LIMIT, crash
from tolcontact.system.resources import limit_resources

__all__ = ["STALL_FACTOR", "TIME_LIMIT", "ChildDiedError", "Refusal", "crash", "environment", "limit_resources", "run_child"]

# Times the processor time that a child may take: one that lives longer does not wait for a processor, it hangs.
STALL_FACTOR = 10


class Refusal(Exception):
    """The fault of a file, as the rest of a sentence that begins with its name."""


class ChildDiedError(Exception):
    """The process did not finish; the message states why."""


def run_child(script: Path, *arguments: str, seconds: float) -> str:
    """Run a Python file, which should begin with `limit_resources`, and return its standard output.

    Raises ChildDiedError if it takes STALL_FACTOR times as long as `seconds` (a busy machine does not make a file a damaged
    one: the limit of its processor time is the file's own), or ends by a signal or an error.
    """
    try:
        completed = subprocess.run(
            [sys.executable, "-P", os.fspath(script), *arguments],
            env=environment(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=STALL_FACTOR * seconds,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise ChildDiedError(f"reading it took longer than {STALL_FACTOR * seconds:.0f} s") from error
    if completed.returncode:
        raise ChildDiedError(_reason(completed))
    return completed.stdout.decode("utf-8", "surrogateescape")


def environment() -> dict[str, str]:
    """Return the environment of a child process, which finds the modules that this process finds."""
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(folder or str(Path.cwd()) for folder in sys.path),
        "PYTHONIOENCODING": "utf-8:surrogateescape",
        "OPENBLAS_NUM_THREADS": "1",  # memory set aside for idle threads counts
    }


def _reason(completed: subprocess.CompletedProcess) -> str:
    if completed.returncode == TIME_LIMIT:
        return "reading it took too long"
    if name := crash(completed.returncode):
        return f"the library that reads it crashed ({name.partition(',')[0]})"
    message = (completed.stderr.decode("utf-8", "replace").strip().splitlines() or ["no message"])[-1]
    if message.startswith("MemoryError"):
        return "reading it takes too much memory"
    return f"the library that reads it failed ({message})"
