"""Progress on standard error, and the message to a user who stops a run."""

import contextlib
import logging
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from tolcontact.errors import shown
from tolcontact.report import grouped
from tolcontact.workflow.forecast import duration

EVERY = 10.0  # s


class Pace:
    """How fast realizations are finished, and how long the others will take."""

    def __init__(self) -> None:
        self.began: tuple[float, int] | None = None  # [s], and how many were there: what a resumed run finds took no time

    def words(self, done: int, total: int) -> str:
        now = time.monotonic()
        if self.began is None:
            self.began = now, done
        seconds, rows = now - self.began[0], done - self.began[1]
        if not (rows and seconds > 0):
            return ""
        return f"{grouped(round(rows / seconds))} a second, {duration((total - done) * seconds / rows)} left"


@contextlib.contextmanager
def shown_progress(name: str, total: int, *, quiet: bool) -> Iterator[Callable[[int, int], None]]:
    """Gives what is to be told how many realizations are done, and of how many; announcements are shown, too.

    A bar on a terminal; elsewhere a line every EVERY seconds; nothing, announcements included, if `quiet`.
    """
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[pace]}"),
    )
    bar = Progress(*columns, console=console, transient=True, disable=quiet or not console.is_terminal)
    pace, last = Pace(), time.monotonic()
    task = bar.add_task(shown(name), total=total, pace="")

    def show(done: int, of: int) -> None:
        nonlocal last
        said = pace.words(done, of)
        bar.update(task, completed=done, total=of, description=shown(name), pace=said)
        if bar.disable and not quiet and time.monotonic() - last > EVERY:
            last = time.monotonic()
            typer.echo(f"{shown(name)}: {grouped(done)} of {grouped(of)}{', ' if said else ''}{said}", err=True)

    with bar, _log_shown(console, lambda words: bar.update(task, description=words), quiet=quiet):
        yield show


@contextlib.contextmanager
def _log_shown(console: Console, show: Callable[[str], None], *, quiet: bool) -> Iterator[None]:
    """Show what the package is doing, and print what it announces."""

    class Shown(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            words = shown(record.getMessage())
            if record.levelno < logging.WARNING:
                show(words)
            elif not quiet:
                console.print(words, markup=False, highlight=False, soft_wrap=True)

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
