"""Output of results and of progress, checks of output files, and the options for entries of the title block of a report."""

import contextlib
import json
import logging
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
import xarray as xr
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Column

from tolcontact import interrupts, report
from tolcontact.cli.app import echo
from tolcontact.declaration import Assembly, TitleBlock
from tolcontact.declaration.script import load_model
from tolcontact.errors import OptionError
from tolcontact.replacing import check_identities
from tolcontact.report.table import grouped
from tolcontact.texts import csv_cell, shown
from tolcontact.vocabulary import BY_STATUS, UNRESOLVED
from tolcontact.workflow.models import duration

if TYPE_CHECKING:
    import pandas as pd

FAILED_SHARE = 0.001
UNBOUNDED = 10_000  # columns outside a terminal
LINE_INTERVAL = 10.0  # s
LONG_WAIT = 300.0  # s remaining, above which advice is given
WAIT = 2.0  # s before a terminal shows what a command is waiting for
WINDOW, MIN_REPORTS = 60.0, 4  # s of the latest reports that determine the rate; number of reports needed for a forecast
Title = Annotated[str | None, typer.Option(help="Title of the report. Default: the model's.", rich_help_panel="Title block")]
PartNumber = Annotated[str | None, typer.Option(help="Part number of the assembly.", rich_help_panel="Title block")]
Author = Annotated[str | None, typer.Option(help="Author of the report.", rich_help_panel="Title block")]
Revision = Annotated[str | None, typer.Option(help="Revision of the model or of its drawing.", rich_help_panel="Title block")]
Date = Annotated[str | None, typer.Option(help="Date of the report, as text.", rich_help_panel="Title block")]
Company = Annotated[str | None, typer.Option(help="Company that issues the report.", rich_help_panel="Title block")]
ENDINGS = {"page": (".html", ".htm"), "spreadsheet": (".xlsx",)}
ENTRIES = tuple(TitleBlock().entries)  # in the order of these options


def console() -> Console:
    """Return a console on standard output; files and pipes have unlimited columns."""
    return Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else UNBOUNDED)


def check_outputs(
    inputs: Iterable[Path],
    *,
    archive: Path | None = None,
    page: Path | None = None,
    spreadsheet: Path | None = None,
    overwrite: bool = False,
) -> None:
    """Raise OptionError unless a command may write its outputs: none is an input or another output, by whatever name.

    Pages of tolcontact are replaced, other pages and spreadsheets only with `overwrite`. Archives are checked when locked.
    """
    named = {"archive": archive, "page": page, "spreadsheet": spreadsheet}
    outputs = {name: path for name, path in named.items() if path is not None}
    check_identities(inputs, outputs)
    for name, path in outputs.items():
        if name == "archive":
            continue
        expected = ENDINGS[name]
        if path.suffix.lower() not in expected:
            raise OptionError(f'"{path}" is not the name of a {name}; expected one that ends in {expected[0]}')
        if not path.parent.is_dir():
            raise OptionError(f'{name} "{path}" cannot be written: there is no folder "{path.parent}"; make it first')
        if not overwrite and path.exists() and not (name == "page" and report.is_page(path)):
            what = ", and is not a tolcontact page" if name == "page" else ""
            raise OptionError(f'"{path}" exists{what}; choose another name, or replace it with --overwrite')


def print_summary(summary: xr.Dataset, *, is_whole: bool = False) -> None:
    """Print the summary of a run, briefly if not whole. Raises typer.Exit with code 1 if too many were not resolved.

    The same holds if a measurement with limits is not a number in some realizations.
    """
    console().print(report.summary_text(summary, is_whole=is_whole))
    failed = sum(int(summary[BY_STATUS.name][status]) for status in UNRESOLVED)
    if failed > FAILED_SHARE * summary.attrs["realizations"]:
        echo(f"error: {failed} realizations were not resolved, more than {FAILED_SHARE:.1%} of all", err=True)
    if failed > FAILED_SHARE * summary.attrs["realizations"] or report.has_no_verdict(summary):
        raise typer.Exit(1)


def print_data(dataset: xr.Dataset) -> None:
    """Print a dataset as JSON, which has no NaN or infinity: they are null, and the texts "Infinity" and "-Infinity"."""
    data = dataset.reset_coords()
    numbers = {name: values.copy(data=_as_json(values.values)) for name, values in data.items() if values.dtype.kind == "f"}
    echo(json.dumps(data.assign(numbers).to_dict(), allow_nan=False, default=_plain))


def print_csv(frame: "pd.DataFrame") -> None:
    """Print a table as CSV, which a spreadsheet opens without running any text in it as a formula."""
    cells = frame.rename(index=csv_cell, columns=csv_cell).map(csv_cell)
    echo(cells.to_csv(lineterminator="\n"), nl=False)


def _as_json(values: np.ndarray) -> np.ndarray:
    objects = values.astype(object)
    for word, places in ((None, np.isnan(values)), ("Infinity", values == np.inf), ("-Infinity", values == -np.inf)):
        objects[places] = word
    return objects


def _plain(value: object) -> object:
    """Return a NumPy number as a JSON value."""
    return value.item() if isinstance(value, np.generic) else str(value)


def title_entries(*options: str | None) -> dict[str, str | None]:
    """Return the entries of a title block by their names, from the options above in their order."""
    return dict(zip(ENTRIES, options, strict=True))


def note_kept_title(archive: Path | None, entries: Mapping[str, str | None]) -> None:
    """Print a note that a resumed archive keeps its title block, if the options state another one."""
    if archive is not None and archive.exists() and any(entries.values()):
        echo(
            f"{archive} keeps the title block that it was begun with; another one for its page: "
            f"tolcontact report {archive} --title ...",
            err=True,
        )


def titled_model(path: Path, entries: Mapping[str, str | None]) -> Assembly:
    """Return the assembly that a file declares, with its title block updated by the `entries` that are not None."""
    assembly = load_model(path)
    if any(entry is not None for entry in entries.values()):
        assembly.title_block = (assembly.title_block or TitleBlock()).overridden(entries)
    return assembly


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
    reports, last, is_advised = deque[tuple[float, int]](), time.monotonic(), quiet  # [s], realizations
    task = bar.add_task(shown(name), total=total, pace="")

    def rate_of(done: int) -> float:
        """Return the recent rate of finished realizations per second; 0 before there are enough reports.

        Realizations that took no time (of a resumed run) and early delays (compilation) do not count.
        """
        now = time.monotonic()
        reports.append((now, done))
        while now - reports[0][0] > WINDOW and len(reports) > MIN_REPORTS:
            reports.popleft()
        seconds, rows = now - reports[0][0], done - reports[0][1]
        return rows / seconds if len(reports) >= MIN_REPORTS and rows > 0 and seconds > 0 else 0.0

    def show(done: int, total: int) -> None:
        nonlocal last, is_advised
        rate = rate_of(done)
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
