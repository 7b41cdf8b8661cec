"""Child processes for files of unknown origin: a library may crash, stall or take too much memory there."""

import os
import sys
from pathlib import Path

from tolcontact.system.machine import limit_resources
from tolcontact.system.processes import TIME_LIMIT, crash, run

__all__ = ["TIME_LIMIT", "ChildDiedError", "Refusal", "crash", "environment", "limit_resources", "run_child"]


class Refusal(Exception):
    """The fault of a file, as the rest of a sentence that begins with its name."""


class ChildDiedError(Exception):
    """The process did not finish; the message states why."""


def run_child(script: Path, argument: str, *, memory: int, seconds: int) -> str:
    """Run a Python file, and return its standard output. Its further arguments are its limits, for `limit_resources`.

    Raises ChildDiedError if it is ended at a limit, or ends by a signal or an error.
    """
    command = [sys.executable, "-P", os.fspath(script), argument, str(memory), str(seconds)]
    code, output, errors, limit = run(command, memory=memory, seconds=seconds, env=environment())
    if code or limit:
        raise ChildDiedError(_reason(code, errors, limit))
    return output.decode("utf-8", "surrogateescape")


def environment() -> dict[str, str]:
    """Return the environment of a child process, which finds the modules that this process finds."""
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(folder or str(Path.cwd()) for folder in sys.path),
        "PYTHONIOENCODING": "utf-8:surrogateescape",
        "OPENBLAS_NUM_THREADS": "1",  # memory set aside for idle threads counts
    }


def _reason(code: int, errors: bytes, limit: str) -> str:
    if limit == "time" or code == TIME_LIMIT:
        return "reading it took too long"
    message = (errors.decode("utf-8", "replace").strip().splitlines() or ["no message"])[-1]
    if limit == "memory" or message.startswith("MemoryError"):
        return "reading it takes too much memory"
    if name := crash(code):
        return f"the library that reads it crashed ({name.partition(',')[0]})"
    return f"the library that reads it failed ({message})"
