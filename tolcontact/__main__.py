"""`python -m tolcontact`, and the console script: the command line, which may be stopped while it is being imported."""

import gc
import os
import sys
from collections.abc import Callable
from typing import NoReturn

from tolcontact import cli, interrupts
from tolcontact.system import machine, streams

MIN_ADDRESS_SPACE = 1_500_000_000  # bytes
MIN_GARBAGE = 200_000  # objects: modules hold no garbage, and looking for it takes a fifth of the time of all imports


def command_line() -> None:
    """Run the command line (see tolcontact.cli)."""
    try:
        with interrupts.stoppable(at_once=True):
            streams.open_closed()
            check_address_space()
            check_threads()
            # Linear algebra has one thread: starting more takes longer than a run, and blocks have threads of their own.
            os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
            machine.skip_plugins()
            gc.set_threshold(MIN_GARBAGE)
            _imported()()
    except KeyboardInterrupt:  # after the end of a command, before the process ends
        interrupts.end("stopped")


def _imported() -> Callable[[], None]:
    try:
        return cli.command_line  # imported here, on first use
    except (ImportError, MemoryError) as error:
        _refuse(f"libraries cannot be loaded ({error}); is there enough memory, and are all of them installed?")


def check_address_space() -> None:
    """Exit with code 2 unless libraries can be loaded: with less address space some of them hang instead of failing."""
    limit = machine.address_space()
    if limit is not None and limit < MIN_ADDRESS_SPACE:
        needed = f"{MIN_ADDRESS_SPACE / 1e9:g} GB"
        _refuse(f"this process may use {limit / 1e9:g} GB of address space, and its libraries need {needed}; raise ulimit -v")


def check_threads() -> None:
    """Exit with code 2 for a number of threads in the environment that Numba would not take."""
    threads = os.environ.get("NUMBA_NUM_THREADS", "1")
    if not (threads.isdecimal() and int(threads)):
        _refuse(f"NUMBA_NUM_THREADS is {threads!r} in the environment; expected a whole number from 1, so set or unset it")


def _refuse(message: str) -> NoReturn:
    sys.stderr.write(f"error: {message}\n")
    sys.exit(2)


if __name__ == "__main__":
    command_line()
