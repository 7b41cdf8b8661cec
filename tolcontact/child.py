"""Child processes for files of unknown origin: a library may crash, stall or take too much memory there."""

import contextlib
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

try:
    import resource
except ImportError:  # not on Windows, where nothing is limited
    resource = None  # type: ignore[assignment]


# Times the processor time that a child may take: one that lives longer does not wait for a processor, it hangs.
STALL_FACTOR = 10
TIME_LIMIT = -signal.SIGXCPU if hasattr(signal, "SIGXCPU") else None  # exit code of a child at the end of its processor time
WINDOWS_CRASH = 0xC0000000  # exit codes from here on are exceptions


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


def limit_resources(memory: int, *, seconds: float | None = None) -> None:
    """Limit this process to `memory` [byte] and to `seconds` of processor time from now on, and let it leave no core."""
    if resource is None:
        return
    limits = {resource.RLIMIT_AS: memory, resource.RLIMIT_CORE: 0}
    if seconds is not None:
        limits[resource.RLIMIT_CPU] = math.ceil(time.process_time() + seconds)
    for name, limit in limits.items():
        _, hard = resource.getrlimit(name)
        allowed = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
        with contextlib.suppress(OSError, ValueError):  # some systems lack a limit
            resource.setrlimit(name, (allowed, hard))


def peak_memory() -> int | None:
    """Return the largest memory [byte] that this process has used so far; None where the system does not tell."""
    if resource is None:
        return None
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def crash(code: int) -> str:
    """Return the signal or the exception that crashed a process with an exit code; "" if it did not."""
    if code < 0:
        name = f", {signal.Signals(-code).name}" if -code in set(signal.Signals) else ""
        return f"signal {-code}{name}"
    return f"exception {code:#x}" if code >= WINDOWS_CRASH else ""


def _reason(completed: subprocess.CompletedProcess) -> str:
    if completed.returncode == TIME_LIMIT:
        return "reading it took too long"
    if name := crash(completed.returncode):
        return f"the library that reads it crashed ({name.partition(',')[0]})"
    message = (completed.stderr.decode("utf-8", "replace").strip().splitlines() or ["no message"])[-1]
    if message.startswith("MemoryError"):
        return "reading it takes too much memory"
    return f"the library that reads it failed ({message})"
