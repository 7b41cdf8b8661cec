"""The command line. Results on stdout, progress and errors on stderr.

Exit codes: 0 done; 1 ran, but more realizations failed than FAILED_SHARE; 2 bad input, one message, nothing written.
"""

import inspect
import json
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
import xarray as xr
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from tolcontact.archive import open_archive
from tolcontact.assembly import Assembly
from tolcontact.comparing import compare as compare_solvers
from tolcontact.errors import TolcontactError
from tolcontact.method import OBJECTIVES, RESOLUTIONS, Method
from tolcontact.report import comparison_text, summary_text
from tolcontact.running import DEFAULT_SOLVER, SURFACES, build, check_counts, check_writable
from tolcontact.running import run as run_model
from tolcontact.script import load_model
from tolcontact.simulation import Status
from tolcontact.statistics import summarize
from tolcontact.vocabulary import KEPT

FAILED_SHARE = 0.001

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


@app.command()
def run(
    model: Model,
    samples: Annotated[int, typer.Option(help="Number of realizations.")] = 1000,
    seed: Annotated[int, typer.Option(help="Seed; the same seed gives the same realizations.")] = 1,
    solver: Annotated[str, typer.Option(help="QP solver, a conic plugin of CasADi.")] = DEFAULT_SOLVER,
    resolution: Annotated[
        str, typer.Option(help=f"One linear step, or as many as it takes: {_or(RESOLUTIONS)}.")
    ] = "linearized",
    objective: Annotated[str, typer.Option(help=f"What the corrected pose minimizes: {_or(OBJECTIVES)}.")] = OBJECTIVES[0],
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
    check_counts(samples=samples, seed=seed, surfaces=surfaces)
    if out is not None:
        check_writable(out, overwrite=overwrite, resume=resume)
    method = Method(resolution=resolution, objective=objective)
    program = build(load_model(model), solver=solver, method=method)
    with Progress(
        TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TimeRemainingColumn(), console=Console(stderr=True), transient=True,
    ) as bar:  # fmt: skip
        task = bar.add_task(program.nominal.assembly.name, total=samples)
        results = run_model(
            program, samples=samples, seed=seed, out=out, overwrite=overwrite, resume=resume, keep=keep, surfaces=surfaces,
            progress=lambda done: bar.update(task, completed=done, total=max(samples, done)),
        )  # fmt: skip
    with results:
        _print_summary(results)
    if out is not None:
        typer.echo(f"\narchive: {out}")


@app.command()
def summary(archive: Archive) -> None:
    """Print the statistics of an archive."""
    with open_archive(archive) as results:
        _print_summary(results)


@app.command()
def compare(
    model: Model,
    solvers: Annotated[str, typer.Option(help="Names of solvers, with commas between; the first one is the reference.")],
    samples: Annotated[int, typer.Option(help="Number of realizations.")] = 1000,
    seed: Annotated[int, typer.Option(help="Seed; the same seed gives the same realizations.")] = 1,
    resolution: Annotated[str, typer.Option(help=f"One or more of {_or(RESOLUTIONS)}.")] = "linearized",
    objective: Annotated[str, typer.Option(help=f"One or more of {_or(OBJECTIVES)}.")] = OBJECTIVES[0],
    as_json: Annotated[bool, typer.Option("--json", help="Print the comparison as JSON.")] = False,
    out: Annotated[Path | None, typer.Option(metavar="FILE.nc", help="Also write it to a new netCDF file.")] = None,
) -> None:
    """Compare solvers, resolutions or objectives on the same draws: agreement, failures, residuals, time."""
    if out is not None:
        check_writable(out, overwrite=False, resume=False)
    methods = [Method(resolution=one, objective=other) for one in _names(resolution) for other in _names(objective)]
    found = compare_solvers(load_model(model), _names(solvers), samples=samples, seed=seed, methods=methods)
    if out is not None:
        # Texts as characters: HDF5's texts of free length crash some versions of the netCDF library.
        texts = {name: {"dtype": "S1"} for name in found.variables if found[name].dtype.kind == "U"}
        found.to_netcdf(out, engine="netcdf4", encoding=texts)
    if as_json:
        # JSON has no NaN: where no realization can be compared a difference is null.
        readable = found.astype(object).where(found.notnull(), None)
        typer.echo(json.dumps(readable.to_dict(), allow_nan=False, default=float))
    else:
        Console(highlight=False, markup=False, width=80).print(comparison_text(found))


def _names(words: str) -> list[str]:
    return [word.strip() for word in words.split(",") if word.strip()]


@app.command()
def check(model: Model) -> None:
    """Say what is wrong with a model; run nothing."""
    program = build(load_model(model))
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
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            app(arguments)
    except TolcontactError as error:
        typer.echo(f"error: {error}", err=True)
        sys.exit(2)
    except OSError as error:
        typer.echo(f"error: the system refused: {error}; an archive that was begun goes on with --resume", err=True)
        sys.exit(2)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    typer.echo(f"warning: {message}", err=True)


def _print_summary(results: xr.DataTree) -> None:
    found = summarize(results)
    Console(highlight=False, markup=False).print(summary_text(found))
    failed = sum(int(found["by_status"][status]) for status in (Status.NOT_CONVERGED, Status.NOT_ASSEMBLABLE, Status.DOUBTFUL))
    if failed > FAILED_SHARE * found.attrs["realizations"]:
        typer.echo(f"error: {failed} realizations were not resolved, more than {FAILED_SHARE:.1%} of all", err=True)
        raise typer.Exit(1)
