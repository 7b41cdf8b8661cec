"""Worker processes that Ctrl-C does not reach, though a terminal sends it to all processes that it shows."""

import contextlib
import signal
from collections.abc import Iterator
from multiprocessing import resource_tracker
from typing import Any

_IGNORE_CTRL_C = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"


@contextlib.contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C in this thread, and in all threads and processes that it starts meanwhile; on Windows, do nothing.

    A thread inherits its blocked signals from the thread that starts it, and a process from the parent's thread.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # start it while SIGINT is not blocked in this thread
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def worker_options() -> dict[str, Any]:
    """Return the options of dask workers that let them ignore Ctrl-C where they cannot inherit that it is blocked."""
    return {} if hasattr(signal, "pthread_sigmask") else {"preload": [_IGNORE_CTRL_C]}
