"""The command line. Results on stdout, progress and errors on stderr.

Exit codes: 0 done; 1 ran, but more realizations failed than FAILED_SHARE; 2 bad input, one message, nothing written;
130 and 143 stopped by Ctrl-C and by a signal to terminate: what is finished is in the archive.
"""

import contextlib
import functools
import inspect
import io
import json
import logging
import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
import xarray as xr
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from tolcontact.archive import open_archive, taken
from tolcontact.declaration import Assembly
from tolcontact.declaration.script import load_model
from tolcontact.errors import OptionError, TolcontactError, shown
from tolcontact.method import OBJECTIVES, RESOLUTIONS, Method
from tolcontact.report import comparison_text, grouped, summary_text
from tolcontact.vocabulary import KEPT, UNRESOLVED
from tolcontact.workflow.compare import compare as compare_solvers
from tolcontact.workflow.run import DEFAULT_SOLVER, SURFACES, build, summarize
from tolcontact.workflow.run import run as run_model

FAILED_SHARE = 0.001
UNBOUNDED = 10_000  # columns of what is no terminal

app = typer.Typer(
    help="Tolerance analysis of rigid assemblies with contact resolved in every realization.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _or(names: tuple[str, ...]) -> str:
    return ", ".join(f'"{name}"' if " " in name else name for name in names)


Model = Annotated[Path, typer.Argument(metavar="MODEL.py", help="Model script with a function assembly().")]
Archive = Annotated[Path, typer.Argument(metavar="FILE.nc", help="Archive of a run.")]
Samples = Annotated[int, typer.Option(help="Number of realizations.")]
Seed = Annotated[int, typer.Option(help="Seed; the same seed gives the same realizations.")]
Solver = Annotated[str, typer.Option(help="QP solver, a conic plugin of CasADi.")]
Resolution = Annotated[str, typer.Option(help=f"One linear step, or as many as it takes: {_or(RESOLUTIONS)}.")]
Objective = Annotated[str, typer.Option(help=f"What the corrected pose minimizes: {_or(OBJECTIVES)}.")]


@app.command()
def run(
    model: Model,
    samples: Samples = 1000,
    seed: Seed = 1,
    solver: Solver = DEFAULT_SOLVER,
    resolution: Resolution = "linearized",
    objective: Objective = OBJECTIVES[0],
    out: Annotated[Path | None, typer.Option(metavar="FILE.nc", help="Archive to write.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the archive if it exists.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the archive if it exists.")] = False,
    keep: Annotated[str, typer.Option(help=f"What to archive of each realization: {_or(KEPT)}.")] = "all",
    surfaces: Annotated[
        int, typer.Option(help="Number of realizations that are checked against the surfaces between contact points.")
    ] = SURFACES,
) -> None:
    """Simulate a model with and without contact, and print what happens to its measures.

    Exit code 1 where more than 0.1 % of the realizations were not resolved: not converged, not assemblable, or doubtful.
    """
    if out is None and (overwrite or resume):
        raise OptionError("--overwrite and --resume speak of an archive, and none is named; name it: --out FILE.nc")
    method = Method(resolution=resolution, objective=objective)
    with _bar() as bar, _stopped(out, done := [0, samples]):
        task = bar.add_task(shown(model.stem), total=samples)
        _show_log(bar.console, lambda words: bar.update(task, description=words))

        def show(rows: int) -> None:
            done[:] = rows, max(samples, rows)
            bar.update(task, completed=rows, total=done[1], description=shown(model.stem))

        results = run_model(
            functools.partial(load_model, model), samples=samples, seed=seed, solver=solver, method=method, out=out,
            overwrite=overwrite, resume=resume, keep=keep, surfaces=surfaces, progress=show,
        )  # fmt: skip
    with results:
        _print_summary(results)
    if out is not None:
        typer.echo(f"\narchive: {shown(str(out))}")


def _bar() -> Progress:
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    return Progress(*columns, TimeRemainingColumn(), console=console, transient=True, disable=not console.is_terminal)


def _show_log(console: Console, show: Callable[[str], None]) -> None:
    """Show what the package is at, and print what it announces."""

    class Shown(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            words = shown(record.getMessage())
            if record.levelno >= logging.WARNING:
                console.print(words, markup=False, highlight=False, soft_wrap=True)
            else:
                show(words)

    log = logging.getLogger("tolcontact")
    log.handlers, log.propagate = [Shown()], False
    log.setLevel(logging.INFO)


@contextlib.contextmanager
def _stopped(out: Path | None, done: list[int]) -> Iterator[None]:
    """Say how far a run came that somebody stops; `done` is how far, and of how many."""
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


@app.command()
def summary(archive: Archive) -> None:
    """Print the statistics of an archive."""
    with open_archive(archive) as results:
        _print_summary(results)


@app.command()
def compare(
    model: Model,
    solvers: Annotated[
        str, typer.Option(help="Names of solvers, with commas between; the first one is the reference.")
    ] = DEFAULT_SOLVER,
    samples: Samples = 1000,
    seed: Seed = 1,
    resolution: Annotated[str, typer.Option(help=f"One or more of {_or(RESOLUTIONS)}.")] = "linearized",
    objective: Annotated[str, typer.Option(help=f"One or more of {_or(OBJECTIVES)}.")] = OBJECTIVES[0],
    as_json: Annotated[bool, typer.Option("--json", help="Print the comparison as JSON.")] = False,
    out: Annotated[Path | None, typer.Option(metavar="FILE.nc", help="Also write it to a new netCDF file.")] = None,
) -> None:
    """Compare solvers, resolutions or objectives on the same draws: agreement, failures, residuals, time."""
    methods = [Method(resolution=one, objective=other) for one in _names(resolution) for other in _names(objective)]
    with contextlib.nullcontext() if out is None else taken(out) as path:
        found = compare_solvers(load_model(model), _names(solvers), samples=samples, seed=seed, methods=methods)
        if path is not None:
            # Texts as characters: HDF5's texts of free length crash some versions of the netCDF library.
            texts = {name: {"dtype": "S1"} for name in found.variables if found[name].dtype.kind == "U"}
            found.to_netcdf(path, engine="netcdf4", encoding=texts)
    if as_json:
        # JSON has no NaN: where no realization can be compared a difference is null.
        readable = found.astype(object).where(found.notnull(), None)
        typer.echo(json.dumps(readable.to_dict(), allow_nan=False, default=float))
    else:
        _console().print(comparison_text(found))


def _names(words: str) -> list[str]:
    return [word.strip() for word in words.split(",") if word.strip()]


@app.command()
def check(
    model: Model,
    solver: Solver = DEFAULT_SOLVER,
    resolution: Resolution = "linearized",
    objective: Objective = OBJECTIVES[0],
) -> None:
    """Say what is wrong with a model, or with running it so; run nothing."""
    program = build(load_model(model), solver=solver, method=Method(resolution=resolution, objective=objective))
    typer.echo(program.nominal.assembly)
    for part in program.nominal.parts:
        size = " x ".join(f"{length:.4g}" for length in part.mesh.extents)
        typer.echo(f"  part {part.name}: {size} mm, {len(part.mesh.faces)} triangles")
    for pair in program.nominal.pairs:
        typer.echo(f"  contact {pair.name}: {len(pair.P_m)} contact points within reach")
    typer.echo("no faults found")


def main(assembly: Callable[[], Assembly]) -> None:
    """Run the script that defines `assembly`, with the options of `tolcontact run`."""
    script = inspect.getsourcefile(assembly)
    command_line([*(["run", script] if script else []), *sys.argv[1:]])


def command_line(arguments: list[str] | None = None) -> None:
    """The console script: `app`, with errors as one message and exit code 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal that knows few letters is no reason to stop
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            app(arguments)
    except TolcontactError as error:
        typer.echo(f"error: {error}", err=True)
        sys.exit(2)
    except OSError as error:
        refused = shown(str(error))
        typer.echo(f"error: the system refused: {refused}; an archive that was begun goes on with --resume", err=True)
        sys.exit(2)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    typer.echo(f"warning: {shown(str(message))}", err=True)


def _console() -> Console:
    """Standard output; what is no terminal is never cut."""
    return Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else UNBOUNDED)


def _print_summary(results: xr.DataTree) -> None:
    found = summarize(results)
    _console().print(summary_text(found))
    failed = sum(int(found["by_status"][status]) for status in UNRESOLVED)
    if failed > FAILED_SHARE * found.attrs["realizations"]:
        typer.echo(f"error: {failed} realizations were not resolved, more than {FAILED_SHARE:.1%} of all", err=True)
        raise typer.Exit(1)
