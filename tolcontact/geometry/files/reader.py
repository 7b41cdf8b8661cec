"""Shape files read in a process of their own: no file ends or stalls this one.

`load` starts `worker` and waits for what it leaves. Where it dies or stalls, the file that it was at gets the blame, and
another one goes on with the rest.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tolcontact.child import environment
from tolcontact.errors import GeometryFault, clipped

# A STEP file of 1 MB takes some 2 s, one of 20 MB 41 s, on one core; machines differ, and other jobs run on them.
SECONDS, SECONDS_PER_MB = 30.0, 20.0
START = 30.0  # [s] until it has loaded its libraries
MEMORY = 6 * 2**30  # [byte]; a million triangles take some 0.5 GiB
PAUSE = 0.02  # [s] between looks at what it has left
PROGRAM = Path(__file__).with_name("worker.py")


class TooSlow(GeometryFault):
    """A file was not read in time: it is damaged, or its triangles are too fine."""


@dataclass(frozen=True)
class Job:
    """A file, its kind ("stl", ..., "step"), and how finely it is cut if it is STEP."""

    path: Path
    kind: str
    chord: float
    angle: float


def load(jobs: Sequence[Job], most: int) -> list[dict[str, np.ndarray] | GeometryFault]:
    """The arrays of each file, as `worker` describes them, or what is wrong with it. `count` alone: more than `most`."""
    done: list[dict[str, np.ndarray] | GeometryFault] = []
    while len(done) < len(jobs):
        done.extend(_by_one_process(jobs[len(done) :], most))
    return done


def _by_one_process(jobs: Sequence[Job], most: int) -> Iterator[dict[str, np.ndarray] | GeometryFault]:
    """What one process makes of the first of some files, up to the one that it fails at."""
    allowed = [SECONDS + SECONDS_PER_MB * job.path.stat().st_size / 1e6 for job in jobs]
    order = {
        "memory": MEMORY,
        "seconds": int((START + sum(allowed)) * (os.cpu_count() or 1)) + 1,
        "most": most,
        "files": [{"path": str(job.path.absolute()), "kind": job.kind, "chord": job.chord, "angle": job.angle} for job in jobs],
    }
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        (folder / "jobs.json").write_text(json.dumps(order))
        with (folder / "errors").open("wb") as errors:
            try:
                process = subprocess.Popen(
                    [sys.executable, "-P", str(PROGRAM), name],
                    stdin=subprocess.DEVNULL,
                    stdout=errors,
                    stderr=errors,
                    # Threads that only wait, and memory set aside for them, would count against its memory.
                    env={**environment(), "MALLOC_ARENA_MAX": "4"},
                )
            except OSError as error:
                yield from [GeometryFault(f'"{job.path}": its reader process cannot be started ({error})') for job in jobs]
                return
        try:
            _awaited(process, START, folder / "ready")
            for k, path in enumerate(job.path for job in jobs):
                if not _awaited(process, allowed[k], folder / f"{k}.npz", folder / f"{k}.txt"):
                    kind = TooSlow if process.poll() is None else GeometryFault
                    yield kind(f'"{path}" {_end(process, folder, allowed[k])}')
                    return
                yield _left(path, folder, k)
        finally:
            process.kill()
            process.wait()


def _awaited(process: subprocess.Popen, seconds: float, *left: Path) -> bool:
    """Whether the process leaves one of some files within some `seconds`."""
    end = time.monotonic() + seconds
    while True:
        ended = process.poll() is not None  # asked first: what it left before it ended counts
        if any(path.exists() for path in left):
            return True
        if ended or time.monotonic() > end:
            return False
        time.sleep(PAUSE)


def _left(path: Path, folder: Path, k: int) -> dict[str, np.ndarray] | GeometryFault:
    said = folder / f"{k}.txt"
    if said.exists():
        return GeometryFault(f'"{path}" {clipped(said.read_text(encoding="utf-8", errors="replace"))}')
    with np.load(folder / f"{k}.npz", allow_pickle=False) as arrays:
        return dict(arrays)


def _end(process: subprocess.Popen, folder: Path, seconds: float) -> str:
    """How a process ended that left nothing, as the rest of a sentence that begins with its file's name."""
    code = process.poll()
    if code is None:
        return (
            f"was not read within {seconds:.0f} s: it is damaged (look for coordinates that are far off), or far too fine; "
            "export it again"
        )
    if code < 0:
        known = code in {-known for known in signal.Signals}
        what = f"signal {-code}" + (f", {signal.Signals(-code).name}" if known else "")
        return f"is damaged: it crashed its reader process ({what}); export it again"
    last = (folder / "errors").read_text(errors="replace").strip().rpartition("\n")[2]
    return f"was not read: its reader process ended with exit code {code} ({clipped(last) or 'no message'}); export it again"
