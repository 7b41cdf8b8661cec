"""Ctrl-C and SIGTERM, which end a command wherever it is.

Python raises KeyboardInterrupt wherever the main thread is. Some libraries catch it (trimesh takes any exception for a
package that is not installed), in callbacks and in the clean-up of objects it is ignored, and in the initialization of some
native modules it ends the process with a memory fault. So it is not raised in these; it is raised again and again until it is
being handled; a command that ends afterwards, for any reason, was stopped.
"""

import _thread
import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from types import FrameType
from typing import Any, NoReturn

INTERVAL = 0.3  # s, after which an interrupt that is not being handled is raised again
MAX_CLEANING = 60.0  # s, after which a process that is still handling it is ended
STOPPED = (signal.SIGINT, signal.SIGTERM)


class _Stop:
    """The first signal of this process, and when it came; 0 before."""

    number = 0
    began = 0.0


@contextlib.contextmanager
def stoppable(at_once: str = "") -> Iterator[None]:
    """Let SIGINT and SIGTERM end the block with KeyboardInterrupt, after which the process has to end (see `end`).

    In other threads than the main one nothing changes.

    at_once   message with which the process ends at once instead, where there is nothing to clean up
    """
    handler = (lambda number, _: end(at_once, number)) if at_once else _interrupt
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: signal.signal(number, handler) for number in STOPPED}
    hook, sys.unraisablehook = sys.unraisablehook, _report_unless_stopped
    try:
        yield
    except BaseException as error:
        if _Stop.number and not isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt from None  # what it became in a library
        raise
    finally:
        if not (_Stop.number or at_once):  # else the process is about to end
            sys.unraisablehook = hook
            for number, former in handlers.items():
                signal.signal(number, former)


def end(message: str, number: int = 0) -> NoReturn:
    """End the process that was stopped: with a message, and the exit code of its signal.

    Threads may compute for minutes, and what is done at exit may wait for them; nothing of it is needed.
    """
    number = number or _Stop.number or signal.SIGINT
    with contextlib.suppress(Exception):  # the terminal is gone, or the signal came while a stream was being written to
        sys.stdout.flush()
    with contextlib.suppress(Exception):
        sys.stderr.write(f"{message}\n")
        sys.stderr.flush()
    os._exit(128 + number)


def _interrupt(number: int, frame: FrameType | None) -> None:
    if _Stop.number and _is_handled():
        return
    if not _Stop.number:
        _Stop.number, _Stop.began = number, time.monotonic()
        _thread.start_new_thread(_insist, (number,))  # a Thread might wait for locks that the main thread holds
    if not _is_loading(frame):
        raise KeyboardInterrupt


def _is_loading(frame: FrameType | None) -> bool:
    """Return whether a native module is being initialized."""
    while frame is not None:
        if frame.f_code.co_qualname.startswith("ExtensionFileLoader."):
            return True
        frame = frame.f_back
    return False


def _is_handled() -> bool:
    """Return whether the main thread is handling KeyboardInterrupt: unwinding its blocks, or in an `except` of it."""
    error: BaseException | None = sys.exc_info()[1]
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__context__
    return False


def _insist(number: int) -> None:
    while True:
        time.sleep(INTERVAL)
        if time.monotonic() > _Stop.began + MAX_CLEANING:
            os._exit(128 + number)
        signal.pthread_kill(threading.main_thread().ident or 0, number)


def _report_unless_stopped(unraisable: Any) -> None:
    """Report an exception that cannot be raised, as usual, but not an interrupt: it will be raised again."""
    if not isinstance(unraisable.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)
