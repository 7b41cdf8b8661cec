"""The process that reads shape files, so that no file can crash or stall this one. A command may start it early.

A job and its result pass through the standard streams of the process, one after the other. Loading the CAD kernel takes as
long as the imports of a small run; started before the files are known, it happens meanwhile.

This is no pool of `concurrent.futures`: its processes import the main script again, which a script without a main guard does
not survive, they cannot be started in a process of such a pool, and the pool does not tell how a process ended.
"""

import contextlib
import os
import pickle
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from tolcontact.child import environment
from tolcontact.errors import GeometryFault
from tolcontact.input_files import fault_of
from tolcontact.system.processes import TIME_LIMIT, Watch, crash
from tolcontact.texts import clipped

PROGRAM = Path(__file__).parent / "geometry" / "files" / "worker.py"
LOAD_KERNEL = "--kernel"  # argument of the program: load the CAD kernel before the first job
MAX_START_SECONDS = 30.0  # until the process has loaded its libraries
STEP_FILE = re.compile(r"\.ste?p$", re.IGNORECASE)
QUOTED_STEP_FILE = re.compile(r"\.ste?p[\"']", re.IGNORECASE)  # in a script, or a model in JSON
_early: "list[Worker]" = []  # at most one, which nobody has taken


@dataclass(frozen=True)
class Job:
    """A file to read, its kind ("stl", ..., "step"), and the limits: processor seconds, memory [byte], number of triangles.

    chord, angle    largest distance [mm] and angle [rad] between triangles and true faces of a STEP file
    has_..., operators   what the text of a STEP file states, and how many operators may mirror its shapes
    """

    path: str
    kind: str
    chord: float
    angle: float
    seconds: float
    memory: int
    triangles: int
    encoding: str = "utf-8"
    has_face_names: bool = False
    has_solids: bool = False
    has_pmi: bool = False
    operators: int = 0

    @property
    def memory_fault(self) -> str:
        """The fault of a file that takes too much memory, as the rest of a sentence that begins with its name."""
        return f"takes more than {self.memory / 2**30:.3g} GiB of memory to read; it is damaged, or far too fine"


class UnfinishedRead(GeometryFault):
    """Reading a file took too long, or crashed: the file is damaged, or its triangles are too fine for the CAD kernel."""


class Worker:
    """A process that reads files, and another one after the end of the former. As a context, it ends the process.

    process   None before its start and after its end
    """

    process: subprocess.Popen[bytes] | None = None

    def start(self, *arguments: str) -> None:
        """Start the process. Raises OSError if it cannot be started."""
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115  (as long as the process)
        self.process = subprocess.Popen(
            [sys.executable, "-P", os.fspath(PROGRAM), *arguments],
            # The memory that is set aside for idle threads would count against the limit.
            env={**environment(), "MALLOC_ARENA_MAX": "4"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process is None:
            return
        process, self.process = self.process, None
        process.kill()
        with self._errors, process, contextlib.suppress(OSError):  # of a job that it did not take
            assert process.stdin is not None
            process.stdin.close()

    def read(self, title: object, job: Job) -> Any:
        """Return what the process reads for a job. Raises GeometryFault about the file with a title if it ends first."""
        try:
            if self.process is None:
                self.start()
        except OSError as error:
            raise GeometryFault(f'"{title}": its reader process cannot be started ({error})') from error
        process = self.process
        assert process is not None and process.stdin is not None and process.stdout is not None
        with Watch(process, memory=job.memory, seconds=job.seconds, start=MAX_START_SECONDS) as watch:
            try:
                pickle.dump(job, process.stdin)
                process.stdin.flush()
                return pickle.load(process.stdout)
            except (EOFError, OSError, pickle.UnpicklingError):
                code = process.wait()
        with self:
            raise self._fault(title, code, watch.limit, job)

    def _fault(self, title: object, code: int, limit: str, job: Job) -> GeometryFault:
        """Return the fault of the file at which the process ended with an exit code, or was ended at a limit."""
        if limit == "time" or code == TIME_LIMIT:
            return UnfinishedRead(
                f'"{title}" took too long: it was not read within {job.seconds:.0f} s of processor time; it is far too fine, '
                "or damaged (look for coordinates that are far off); export it again"
            )
        if limit == "memory":
            return GeometryFault(f'"{title}" {job.memory_fault}')
        if name := crash(code):
            return UnfinishedRead(
                f'"{title}" cannot be read: it crashed its reader process ({name}); it is damaged, or beyond the CAD kernel; '
                "export it again"
            )
        self._errors.seek(0)
        message = clipped(self._errors.read().decode("utf-8", "replace").strip().rpartition("\n")[2]) or "no message"
        return GeometryFault(
            f'"{title}" was not read: its reader process ended with exit code {code} ({message}); export it again'
        )


def start_early(arguments: Iterable[str]) -> Worker | None:
    """Start and return a worker that loads the CAD kernel, if an argument of a command is a STEP file or names one.

    An argument that is a model names a STEP file if its text does. None is returned if no process is started.
    """
    if _early or not any(map(_needs_kernel, arguments)):
        return None
    worker = Worker()
    with contextlib.suppress(OSError):  # it is started again when it is needed
        worker.start(LOAD_KERNEL)
        _early.append(worker)
        return worker
    return None


def _needs_kernel(argument: str) -> bool:
    path = Path(argument)
    try:
        if fault_of(path):
            return False
        if STEP_FILE.search(argument):
            return True
        is_model = path.suffix.lower() in (".py", ".json")
        return is_model and bool(QUOTED_STEP_FILE.search(path.read_text(encoding="utf-8", errors="ignore")))
    except (OSError, ValueError):  # not a file
        return False


def taken() -> Worker:
    """Return the worker that was started early, if its process is still there, or one that starts when it is needed."""
    while _early:
        worker = _early.pop()
        if worker.process is not None and worker.process.poll() is None:
            return worker
        with worker:
            pass
    return Worker()


def end_unused() -> None:
    """End the process that was started early, if no file was read."""
    while _early:
        with _early.pop():
            pass
