"""Progress on standard error, and the message to a user who stops a run."""

import contextlib
import logging
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from tolcontact.errors import shown
from tolcontact.report import grouped


def progress_bar() -> Progress:
    """A bar of realizations; nothing if standard error is not a terminal."""
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    return Progress(*columns, TimeRemainingColumn(), console=console, transient=True, disable=not console.is_terminal)


@contextlib.contextmanager
def log_shown(console: Console, show: Callable[[str], None]) -> Iterator[None]:
    """Show what the package is doing, and print what it announces."""

    class Shown(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            words = shown(record.getMessage())
            if record.levelno >= logging.WARNING:
                console.print(words, markup=False, highlight=False, soft_wrap=True)
            else:
                show(words)

    log, handler = logging.getLogger("tolcontact"), Shown()
    before = log.level
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(before)


@contextlib.contextmanager
def stopped(out: Path | None, done: list[int]) -> Iterator[None]:
    """Report how far a run came if it is stopped; `done` is how far, and of how many."""
    stopped_by = [signal.SIGINT]

    def terminate(number: int, _: object) -> None:
        stopped_by[0] = signal.Signals(number)
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    except KeyboardInterrupt:
        go_on = "continue with --resume" if out is not None and out.exists() else "nothing is kept"
        typer.echo(f"stopped: {grouped(done[0])} of {grouped(done[1])} done; {go_on}", err=True)
        sys.stderr.flush()
        # What threads still compute is not waited for: it is not in the archive, and may take minutes.
        os._exit(128 + stopped_by[0])
    finally:
        signal.signal(signal.SIGTERM, before)
