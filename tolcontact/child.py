"""Child processes for files of unknown origin, in which a library may crash, stall or take too much memory."""

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

try:
    import resource
except ImportError:  # not on Windows, where nothing is limited
    resource = None  # type: ignore[assignment]


STALL_FACTOR = (
    10  # times the processor time that a child may take: one that lives longer does not wait for a processor, it hangs
)


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


def limit_resources(memory: int, *, file_size: int | None = None, seconds: int | None = None) -> None:
    """Limit this process to `memory` [byte], files of `file_size` [byte] and processor `seconds`, and let it leave no core."""
    if resource is None:
        return
    limits = {
        resource.RLIMIT_AS: memory,
        resource.RLIMIT_FSIZE: file_size,
        resource.RLIMIT_CPU: seconds,
        resource.RLIMIT_CORE: 0,
    }
    for name, limit in limits.items():
        if limit is not None:
            _, hard = resource.getrlimit(name)
            allowed = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
            with contextlib.suppress(OSError, ValueError):  # some systems lack a limit
                resource.setrlimit(name, (allowed, allowed))


def processor_time(pid: int) -> float:
    """Return the processor time [s] that a running child has taken so far; 0 where the system does not tell."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")  # in user and in system mode


def peak_memory() -> int | None:
    """Return the largest memory [byte] that this process has used so far; None where the system does not tell."""
    return None if resource is None else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _reason(completed: subprocess.CompletedProcess) -> str:
    if completed.returncode == -signal.SIGXCPU:
        return "reading it took too long"
    if completed.returncode < 0:
        return f"the library that reads it crashed (signal {-completed.returncode})"
    message = (completed.stderr.decode("utf-8", "replace").strip().splitlines() or ["no message"])[-1]
    if message.startswith("MemoryError"):
        return "reading it takes too much memory"
    return f"the library that reads it failed ({message})"
