"""Ctrl-C, SIGTERM, Ctrl-Break: the first one ends a command with KeyboardInterrupt, a further one ends the process at once."""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any, NoReturn

# Ctrl-C, an order to end, and Ctrl-Break of Windows, which never delivers the order.
STOPPING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name))
_received: list[int] = []  # signals


def end(message: str) -> NoReturn:
    """End the process with a message and the exit code of its signal: threads may compute for minutes, and an exit waits."""
    with contextlib.suppress(Exception):  # the terminal is gone, or the signal came while a stream was being written to
        sys.stdout.flush()
    with contextlib.suppress(OSError):
        os.write(2, f"{message}\n".encode(errors="backslashreplace"))
    os._exit(128 + (_received[0] if _received else signal.SIGINT))


def is_stopping() -> bool:
    """Return whether a signal to stop has been received."""
    return bool(_received)


@contextlib.contextmanager
def stoppable(*, at_once: bool = False) -> Iterator[None]:
    """Let signals end the block with KeyboardInterrupt, whatever a library makes of it; with `at_once`, end the process."""

    def stop(number: int, _: Any) -> None:
        _received.append(number)
        if at_once or len(_received) > 1:  # nothing to clean up, or a library ignored the first signal
            end("stopped")
        raise KeyboardInterrupt

    is_main = threading.current_thread() is threading.main_thread()
    handlers = {number: signal.signal(number, stop) for number in STOPPING if is_main}
    try:
        yield
    except BaseException as error:
        if _received:
            raise KeyboardInterrupt from error
        raise
    finally:
        if not _received:
            for number, handler in handlers.items():
                signal.signal(number, handler)
