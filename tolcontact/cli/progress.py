"""Progress on standard error, the current activity of a command, and the message of a run that a user stops."""

import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Column

from tolcontact import interrupts
from tolcontact.cli.app import echo
from tolcontact.report.table import grouped
from tolcontact.texts import duration, shown

LINE_INTERVAL = 10.0  # s
LONG_WAIT = 300.0  # s remaining, above which advice is given
WAIT = 2.0  # s before a terminal shows what a command is waiting for

WINDOW, MIN_REPORTS = 60.0, 4  # s of the latest reports that determine the rate; number of reports needed for a forecast


class Pace:
    """The recent rate of finished realizations, and the remaining time.

    Realizations that took no time (of a resumed run) and early delays (compilation) do not count.
    """

    def __init__(self) -> None:
        self._reports: deque[tuple[float, int]] = deque()  # [s], realizations

    def rate(self, done: int) -> float:
        """Return the finished realizations per second; 0 before there are enough reports."""
        now = time.monotonic()
        self._reports.append((now, done))
        while now - self._reports[0][0] > WINDOW and len(self._reports) > MIN_REPORTS:
            self._reports.popleft()
        seconds, rows = now - self._reports[0][0], done - self._reports[0][1]
        return rows / seconds if len(self._reports) >= MIN_REPORTS and rows > 0 and seconds > 0 else 0.0


@contextlib.contextmanager
def shown_progress(
    name: str, total: int, *, quiet: bool, interval: float = LINE_INTERVAL, long_wait: float = LONG_WAIT
) -> Iterator[Callable[[int, int], None]]:
    """Yield a function of the finished and the total number of realizations that shows progress; also show announcements.

    Progress is a bar on a terminal, and elsewhere a line after each `interval` [s]. If more than `long_wait` [s] remain at the
    first forecast, a line states how to save time. With `quiet` nothing is shown.
    """
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(table_column=Column(min_width=2 * len(str(total)) + 1)),
        TextColumn("{task.fields[pace]}"),
    )
    bar = Progress(*columns, console=console, transient=True, disable=quiet or not console.is_terminal)
    pace, last, is_advised = Pace(), time.monotonic(), quiet
    task = bar.add_task(shown(name), total=total, pace="")

    def show(done: int, total: int) -> None:
        nonlocal last, is_advised
        rate = pace.rate(done)
        remaining = (total - done) / rate if rate else 0.0
        speed = f"{grouped(round(rate))} a second, {duration(remaining)} left" if rate else ""
        if rate and not is_advised:
            is_advised = True
            if remaining > long_wait:
                advice = (
                    f"{shown(name)}: about {duration(remaining)} left; fewer --samples take less time, with wider intervals"
                )
                console.print(advice, markup=False, highlight=False, soft_wrap=True)
        # What follows a quick run may announce something else before the bar is drawn again.
        bar.update(task, completed=done, total=total, description=shown(name), pace=speed, refresh=done == total)
        if bar.disable and not quiet and time.monotonic() - last > interval:
            last = time.monotonic()
            echo(f"{name}: {grouped(done)} of {grouped(total)}{', ' if speed else ''}{speed}", err=True)

    with bar, _log_shown(console, lambda message: bar.update(task, description=message), quiet=quiet):
        yield show


@contextlib.contextmanager
def waiting(text: str) -> Iterator[None]:
    """Show on a terminal what a command is waiting for, and for how long, once it takes longer than WAIT."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    columns = SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn()
    display = Progress(*columns, console=console, transient=True)
    display.add_task(shown(text), total=None)
    timer = threading.Timer(WAIT, display.start)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
        display.stop()


@contextlib.contextmanager
def _log_shown(console: Console, show: Callable[[str], None], *, quiet: bool) -> Iterator[None]:
    """Show the log of the package in the progress bar, and print its warnings."""

    class Shown(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            message = shown(record.getMessage())
            if record.levelno < logging.WARNING:
                show(message)
            elif not quiet:
                console.print(message, markup=False, highlight=False, soft_wrap=True)

    log, handler = logging.getLogger("tolcontact"), Shown()
    level = log.level
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(level)


@contextlib.contextmanager
def stopped(out: Path | None, done: list[int]) -> Iterator[None]:
    """End a stopped run with a message about its progress; `done` is the finished and the total number of realizations."""
    try:
        yield
    except KeyboardInterrupt:
        advice = "continue with --resume" if out is not None and out.exists() else "nothing is kept"
        interrupts.end(f"stopped: {grouped(done[0])} of {grouped(done[1])} done; {advice}")
