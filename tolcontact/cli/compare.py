"""tolcontact compare."""

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
import xarray as xr

from tolcontact.archive import open_archive, taken
from tolcontact.cli.app import AsJson, Samples, Scheduler, Seed, Workers, app, chosen, examples, or_
from tolcontact.cli.output import check_page, console, print_data
from tolcontact.declaration.script import load_model
from tolcontact.errors import OptionError, shown
from tolcontact.method import OBJECTIVES, RESOLUTIONS
from tolcontact.report import comparison_text, runs_text, write_comparison
from tolcontact.simulation.cluster import client_of
from tolcontact.workflow.models import DEFAULT_SOLVER
from tolcontact.workflow.run_comparison import compare_runs, named_archives
from tolcontact.workflow.solver_comparison import compare as compare_solvers

_ONE_OR_MORE = "One or more of {}. Default: the model's."
_OF_MODELS = ("solvers", "samples", "seed", "resolution", "objective", "workers", "scheduler")


@app.command(
    epilog=examples(
        "compare model.py --solvers daqp,qpoases", "compare model.py --resolution linearized,exact",
        "compare before.nc after.nc --report both.html",
    )
)  # fmt: skip
def compare(
    context: typer.Context,
    what: Annotated[
        list[Path],
        typer.Argument(metavar="MODEL.py | FILE.nc FILE.nc ...", help="A model, or archives; the first is the reference."),
    ],
    solvers: Annotated[
        str, typer.Option(help="Names of solvers, separated by commas; the first one is the reference.")
    ] = DEFAULT_SOLVER,
    samples: Samples = 1000,
    seed: Seed = 1,
    resolution: Annotated[str | None, typer.Option(help=_ONE_OR_MORE.format(or_(RESOLUTIONS)))] = None,
    objective: Annotated[str | None, typer.Option(help=_ONE_OR_MORE.format(or_(OBJECTIVES)))] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    as_json: AsJson = False,
    out: Annotated[Path | None, typer.Option(metavar="FILE.nc", help="Also write it to a new netCDF file.")] = None,
    report: Annotated[Path | None, typer.Option(metavar="FILE.html", help="Of archives: also write a page to look at.")] = None,
) -> None:
    """Compare solvers, resolutions or objectives of a model on the same draws; or archives with each other.

    Of a model: agreement, failures, residuals, time. Of archives, from the same draws or not: how measures change.
    """
    of_archives = [path.suffix.lower() == ".nc" for path in what]
    if not all(of_archives) and len(what) > 1:
        raise OptionError(f"{', '.join(map(str, what))} are not one model, nor archives (.nc); expected one of these")
    given = [word for word in _OF_MODELS if context.get_parameter_source(word).name == "COMMANDLINE"]  # type: ignore[union-attr]
    if all(of_archives) and given:
        raise OptionError(f"--{given[0]} is for models; runs in archives have their own")
    if report is not None:
        if not all(of_archives):
            raise OptionError("--report is for archives; write one for each solver (run --out), and compare these")
        check_page(report)
    with contextlib.nullcontext() if out is None else taken(out) as path:
        if all(of_archives):
            found = _of_archives(what, report)
        else:
            methods = [chosen(resolution=one, objective=other) for one in _names(resolution) for other in _names(objective)]
            with client_of(workers, scheduler) as client:
                found = compare_solvers(
                    load_model(what[0]), _listed(solvers), samples=samples, seed=seed, methods=methods, client=client
                )
        if path is not None:
            # Texts as characters: HDF5's texts of free length crash some versions of the netCDF library.
            texts = {name: {"dtype": "S1"} for name in found.variables if found[name].dtype.kind == "U"}
            found.to_netcdf(path, engine="netcdf4", encoding=texts)
    if as_json:
        print_data(found)
    else:
        console().print((runs_text if all(of_archives) else comparison_text)(found))
        if report is not None:
            typer.echo(f"\nreport: {shown(str(report))}")


def _of_archives(files: Sequence[Path], report: Path | None) -> xr.Dataset:
    with contextlib.ExitStack() as stack:
        runs = {name: stack.enter_context(open_archive(path)) for name, path in named_archives(files).items()}
        found = compare_runs(runs)
        if report is not None:
            write_comparison(runs, found, report)
    return found


def _names(words: str | None) -> Sequence[str | None]:
    return [None] if words is None else _listed(words)


def _listed(words: str) -> list[str]:
    return [word.strip() for word in words.split(",") if word.strip()]
