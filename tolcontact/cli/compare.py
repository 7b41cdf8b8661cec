"""tolcontact compare."""

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
import xarray as xr

from tolcontact import report as reports
from tolcontact.archive import locked_archive, open_archive, replacing_archive
from tolcontact.cli import app as common
from tolcontact.cli.output import check_outputs, console, print_data
from tolcontact.declaration.script import load_model
from tolcontact.errors import OptionError
from tolcontact.input_files import is_archive
from tolcontact.method import OBJECTIVES, RESOLUTIONS
from tolcontact.simulation.cluster import client_of
from tolcontact.system import files
from tolcontact.workflow.comparison import compare as compare_solvers, compare_runs, named_archives
from tolcontact.workflow.models import DEFAULT_SOLVER

SEVERAL = "One or more of {}. Default: the model's."
MODEL_OPTIONS = ("solvers", "samples", "seed", "resolution", "objective", "workers", "scheduler")


@common.app.command(
    epilog=common.examples(
        "compare model.py --solvers daqp,qpoases", "compare model.py --resolution linearized,exact",
        "compare before.nc after.nc --report both.html",
    )
)  # fmt: skip
def compare(
    context: typer.Context,
    inputs: Annotated[
        list[Path],
        typer.Argument(metavar="MODEL.py | FILE.nc FILE.nc ...", help="A model, or archives; the first is the reference."),
    ],
    solvers: Annotated[
        str, typer.Option(help="Names of solvers, separated by commas; the first one is the reference.")
    ] = DEFAULT_SOLVER,
    samples: common.Samples = 1000,
    seed: common.Seed = 1,
    resolution: Annotated[str | None, typer.Option(help=SEVERAL.format(common.or_(RESOLUTIONS)))] = None,
    objective: Annotated[str | None, typer.Option(help=SEVERAL.format(common.or_(OBJECTIVES)))] = None,
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
    as_json: common.AsJson = False,
    out: Annotated[Path | None, typer.Option(metavar="FILE.nc", help="Also write the comparison to a new netCDF file.")] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="For archives: also write a page for a browser.")
    ] = None,
    overwrite: common.Overwrite = False,
) -> None:
    """Compare solvers, resolutions or objectives of a model on the same draws, or archives with each other.

    For a model, print agreement, failures, residuals and time. For archives, print how measurements change.
    """
    are_archives = [is_archive(path) for path in inputs]
    if not all(are_archives) and len(inputs) > 1:
        raise OptionError(f"{', '.join(map(str, inputs))} are neither one model nor archives (.nc)")
    options = [name for name in MODEL_OPTIONS if name in common.set_options(context)]
    if all(are_archives) and options:
        raise OptionError(f"--{options[0]} applies to a model; archives have their own")
    if report is not None and not all(are_archives):
        raise OptionError("--report applies to archives; write an archive for each solver (run --out), and compare these")
    check_outputs(inputs, comparison=out, page=report, overwrite=overwrite)
    with contextlib.nullcontext() if out is None else locked_archive(out, overwrite=overwrite) as path:
        if all(are_archives):
            comparison = _compare_archives(inputs, report)
        else:
            methods = [
                common.method_choices(resolution=name, objective=goal)
                for name in _names(resolution)
                for goal in _names(objective)
            ]
            with client_of(workers, scheduler) as client:
                comparison = compare_solvers(
                    load_model(inputs[0]), _listed(solvers), samples=samples, seed=seed, methods=methods, client=client
                )
        if path is not None:
            # Texts as characters: HDF5's variable-length strings crash some versions of the netCDF library.
            texts = {name: {"dtype": "S1"} for name in comparison.variables if comparison[name].dtype.kind == "U"}
            with replacing_archive(path) as part:
                comparison.to_netcdf(files.plain_path(part), engine="netcdf4", encoding=texts)
    if as_json:
        print_data(comparison)
    else:
        console().print((reports.runs_text if all(are_archives) else reports.comparison_text)(comparison))
        if report is not None:
            common.echo(f"\nreport: {report}")


def _compare_archives(archives: Sequence[Path], report: Path | None) -> xr.Dataset:
    with contextlib.ExitStack() as stack:
        runs = {name: stack.enter_context(open_archive(path)) for name, path in named_archives(archives).items()}
        comparison = compare_runs(runs)
        if report is not None:
            reports.write_comparison(runs, comparison, report)
    return comparison


def _names(text: str | None) -> Sequence[str | None]:
    return [None] if text is None else _listed(text)


def _listed(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]
