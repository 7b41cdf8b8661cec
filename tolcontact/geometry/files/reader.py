"""Shape files read in another process: no file can end or stall this one.

`load` starts `worker` and waits for the files that it writes. If the worker dies or stalls, the shape file that it was reading
is at fault, and another worker reads the remaining ones.
"""

import json
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tolcontact import shape_worker
from tolcontact.child import STALL_FACTOR, processor_time
from tolcontact.errors import GeometryFault, clipped

MAX_START_SECONDS = 30.0  # until the worker has loaded its libraries
POLL_SECONDS = 0.005  # between two looks for a file of the worker


class UnfinishedRead(GeometryFault):
    """Reading a file took too long, or crashed: the file is damaged, or its triangles are too fine for the CAD kernel."""


@dataclass(frozen=True)
class ReadingLimits:
    """The limits for reading a file: processor time, memory [byte] and number of triangles.

    On an idle core a STEP file of 1 MB takes some 2 s, one of 20 MB 41 s. A million triangles take some 0.5 GiB to read, and
    some 3 GiB on the way through a simulation with contact on all of them.
    """

    seconds: float = 30.0
    seconds_per_mb: float = 20.0
    memory: int = 6 * 2**30
    triangles: int = 1_000_000


DEFAULT_LIMITS = ReadingLimits()


@dataclass(frozen=True)
class Job:
    """A file and its kind ("stl", ..., "step"); the chord [mm] and angle [rad] of its triangles if it is a STEP file."""

    path: Path
    kind: str
    chord: float
    angle: float


def load(jobs: Sequence[Job], limits: ReadingLimits = DEFAULT_LIMITS) -> list[dict[str, np.ndarray] | GeometryFault]:
    """Return the arrays of each file, as `worker` describes them, or its fault.

    A file with too many triangles has only the array `count`.
    """
    results: list[dict[str, np.ndarray] | GeometryFault] = []
    while len(results) < len(jobs):
        results.extend(_by_one_process(jobs[len(results) :], limits))
    return results


def _by_one_process(jobs: Sequence[Job], limits: ReadingLimits) -> Iterator[dict[str, np.ndarray] | GeometryFault]:
    """Yield the results of one worker process, up to the file that it fails at."""
    seconds = [limits.seconds + limits.seconds_per_mb * job.path.stat().st_size / 1e6 for job in jobs]
    order = {
        "memory": limits.memory,
        "seconds": int((MAX_START_SECONDS + sum(seconds)) * (os.cpu_count() or 1)) + 1,
        "max_triangles": limits.triangles,
        "files": [{"path": str(job.path.absolute()), "kind": job.kind, "chord": job.chord, "angle": job.angle} for job in jobs],
    }
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        (folder / "jobs.json").write_text(json.dumps(order))
        try:
            process = shape_worker.started(folder)
        except OSError as error:
            yield from [GeometryFault(f'"{job.path}": its reader process cannot be started ({error})') for job in jobs]
            return
        try:
            _wait_for(process, MAX_START_SECONDS, folder / "ready")
            for k, path in enumerate(job.path for job in jobs):
                if not _wait_for(process, seconds[k], folder / f"{k}.npz", folder / f"{k}.txt"):
                    kind = UnfinishedRead if (process.poll() or -1) < 0 else GeometryFault
                    yield kind(f'"{path}" {_end(process, folder, seconds[k])}')
                    return
                yield _result(path, folder, k)
        finally:
            process.kill()
            process.wait()


def _wait_for(process: subprocess.Popen, seconds: float, *paths: Path) -> bool:
    """Return whether the process writes a file at one of the paths within some `seconds` of processor time.

    On a busy machine it may take STALL_FACTOR times as long; it is not waited for any longer.
    """
    end, last = time.monotonic() + STALL_FACTOR * seconds, processor_time(process.pid) + seconds
    while True:
        ended = process.poll() is not None  # before the look for files: one that was written just before the end counts
        if any(path.exists() for path in paths):
            return True
        if ended or time.monotonic() > end or processor_time(process.pid) > last:
            return False
        time.sleep(POLL_SECONDS)


def _result(path: Path, folder: Path, k: int) -> dict[str, np.ndarray] | GeometryFault:
    message = folder / f"{k}.txt"
    if message.exists():
        return GeometryFault(f'"{path}" {clipped(message.read_text(encoding="utf-8", errors="replace"))}')
    with np.load(folder / f"{k}.npz", allow_pickle=False) as arrays:
        return dict(arrays)


def _end(process: subprocess.Popen, folder: Path, seconds: float) -> str:
    """Return how a process ended without a result, as the rest of a sentence that begins with the name of its shape file."""
    code = process.poll()
    if code is None:
        return (
            f"took too long: it was not read within {seconds:.0f} s of processor time; it is far too fine, or damaged (look "
            "for coordinates that are far off); export it again"
        )
    if code < 0:
        name = f", {signal.Signals(-code).name}" if -code in set(signal.Signals) else ""
        end = f"it crashed its reader process (signal {-code}{name})"
        return f"cannot be read: {end}; it is damaged, or beyond the CAD kernel; export it again"
    message = (folder / "errors").read_text(errors="replace").strip().rpartition("\n")[2]
    return f"was not read: its reader process ended with exit code {code} ({clipped(message) or 'no message'}); export it again"
