"""Child processes: the watch that ends one that takes longer, or more memory, than it may, and exit codes of others.

A process limits its own memory and processor time where its system does (see `limit_resources`). Where it does not, its parent
looks at what it has used: a library that reads a file may hold all threads of its own process.
"""

import signal
import subprocess
import threading
import time
from typing import Any, Self

import lazy_loader

from tolcontact.system.machine import ENFORCED

psutil = lazy_loader.load("psutil")  # where the system sets no limits

STALL_FACTOR = 10  # times the processor time: a process that lives longer does not wait for a processor, it hangs
TIME_LIMIT = -signal.SIGXCPU if hasattr(signal, "SIGXCPU") else None  # exit code of a child at the end of its processor time
WINDOWS_CRASH = 0xC0000000  # exit codes from here on are exceptions
_IS_ENFORCED = ENFORCED >= {"time", "memory"}
_INTERVAL = 0.1  # s between two looks


class Watch:
    """A watch over a process, as a context.

    limit   "time" or "memory", once the process was ended for it; else ""
    """

    limit = ""

    def __init__(self, process: subprocess.Popen[bytes], *, memory: int, seconds: float, start: float = 0.0) -> None:
        """Watch a process that may use `memory` [byte] and `seconds` of processor time, and take `start` [s] to begin."""
        self._process, self._memory, self._seconds = process, memory, seconds
        self._is_done = threading.Event()
        self._last = time.monotonic() + start + STALL_FACTOR * seconds
        self._thread = threading.Thread(target=self._look, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_done.set()
        self._thread.join()

    def _look(self) -> None:
        usage = None if _IS_ENFORCED else psutil.Process(self._process.pid)
        used = _processor_time(usage)
        while not self._is_done.wait(_INTERVAL if usage else self._last - time.monotonic()):
            try:
                if time.monotonic() >= self._last or _processor_time(usage) - used > self._seconds:
                    self.limit = "time"
                elif usage and usage.memory_info().rss > self._memory:
                    self.limit = "memory"
            except psutil.Error:  # the process has ended
                return
            if self.limit:
                self._process.kill()
                return


def _processor_time(usage: Any) -> float:
    return sum(usage.cpu_times()[:2]) if usage else 0.0


def run(command: list[str], *, memory: int, seconds: float, **options: Any) -> tuple[int, bytes, bytes, str]:
    """Run a command under a watch; return its exit code, its output and errors, and the limit at which it was ended, if any."""
    pipes: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, **pipes, **options) as process, Watch(process, memory=memory, seconds=seconds) as watch:
        try:
            output, errors = process.communicate()
        except BaseException:
            process.kill()
            raise
    return process.returncode, output, errors, watch.limit


def crash(code: int) -> str:
    """Return the signal or the exception that crashed a process with an exit code; "" if it did not."""
    if code < 0:
        name = f", {signal.Signals(-code).name}" if -code in set(signal.Signals) else ""
        return f"signal {-code}{name}"
    return f"exception {code:#x}" if code >= WINDOWS_CRASH else ""
