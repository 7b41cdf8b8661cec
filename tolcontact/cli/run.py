"""tolcontact run, tolcontact compare."""

import contextlib
import functools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from xarray import Dataset

import tolcontact
from tolcontact import report as reports
from tolcontact.archive import Run, locked_archive, open_archive, open_unchecked, replacing_archive
from tolcontact.cli import app as common, output
from tolcontact.cli.output import print_summary, shown_progress, stopped
from tolcontact.declaration.script import load_model
from tolcontact.errors import OptionError
from tolcontact.method import OBJECTIVES, RESOLUTIONS
from tolcontact.replacing import temporary_folder
from tolcontact.simulation.cluster import client_of
from tolcontact.statistics import Summary
from tolcontact.system import files
from tolcontact.vocabulary import KEPT, MONTE_CARLO, PLANS, STACK_UP
from tolcontact.workflow.accessor import summarize
from tolcontact.workflow.comparison import compare as compare_solvers, compare_runs, named_archives
from tolcontact.workflow.models import DEFAULT_SOLVER
from tolcontact.workflow.runs import SURFACES, Target, write_run

MAX_STACK = 100_000  # realizations of the table of a stack
SEVERAL = "One or more of {}. Default: the model's."
MODEL_OPTIONS = ("solvers", "samples", "seed", "resolution", "objective", "workers", "scheduler")
Until = Annotated[
    str | None,
    typer.Option(
        metavar="TEXT", help='Sample until this interval is narrow enough: "MEASURE: 6 sigma +-1 %", "...: ppm +-20 %".'
    ),
]


@common.app.command(
    epilog=common.examples(
        "run model.py --samples 10000",
        "run model.py --out run.nc --report run.html",
        "run model.py --out run.nc --resume",
        "run model.py --samples 1000000 --out run.nc --workers 8",
    )
)
def run(
    model: common.Model,
    samples: common.Samples = 1000,
    seed: common.Seed = 1,
    solver: common.Solver = DEFAULT_SOLVER,
    resolution: common.Resolution = None,
    objective: common.Objective = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE.nc", help="Archive to write.")] = None,
    overwrite: common.Overwrite = False,
    resume: Annotated[bool, common.flag("--resume", "Continue the archive if it exists.")] = False,
    keep: Annotated[str, typer.Option(help=f"Variables to archive for each realization: {common.or_(KEPT)}.")] = "all",
    fields: Annotated[
        str, typer.Option(metavar="some|all|N|none", help="Number of realizations behind magnitudes of displacement fields.")
    ] = "some",
    plan: Annotated[str, typer.Option(help=f"Plan of the draws: {common.or_(PLANS)}.")] = MONTE_CARLO,
    until: Until = None,
    surfaces: Annotated[
        int, typer.Option(help="Number of realizations that are checked between contact points, on the surfaces.")
    ] = SURFACES,
    report: Annotated[Path | None, typer.Option(metavar="FILE.html", help="Also write a page for a browser.")] = None,
    title: output.Title = None,
    part_number: output.PartNumber = None,
    author: output.Author = None,
    revision: output.Revision = None,
    date: output.Date = None,
    company: output.Company = None,
    workers: common.Workers = None,
    scheduler: common.Scheduler = None,
    quiet: common.Quiet = False,
) -> None:
    """Simulate a model with and without contact, and print the statistics of its measurements.

    The exit code is 1 if more than 0.1 % of the realizations were not resolved (not converged, not assemblable, or doubtful),
    if a measurement with limits is not a number in some, and if an interval is not as narrow as --until states.
    """
    report = _checked_page(model, out, report, overwrite=overwrite, resume=resume)
    method = common.method_choices(resolution=resolution, objective=objective)
    titles = output.title_entries(title, part_number, author, revision, date, company)
    output.note_kept_title(out if resume else None, titles)
    # A stop first restores the cursor.
    with (
        stopped(out, done := [0, samples]),
        shown_progress(model.stem, samples, quiet=quiet) as show,
        client_of(workers, scheduler) as client,
        temporary_folder() as folder,
    ):

        def progress(rows: int) -> None:
            done[:] = rows, max(samples, rows)
            show(*done)

        path = write_run(
            functools.partial(output.titled_model, model, titles),
            Run(seed, samples, keep, surfaces, int(fields) if re.fullmatch(r"[0-9]{1,18}", fields) else fields, plan),
            out or folder / "results.nc", solver=solver, method=method, overwrite=overwrite and out is not None,
            resume=resume, until=until, client=client, progress=progress,
        )  # fmt: skip
        summary, stack, shortfall = _summed_up(path, until, report)
    _print_results(summary, stack, out, shortfall, quiet=quiet)


def _checked_page(model: Path, out: Path | None, report: Path | None, *, overwrite: bool, resume: bool) -> Path | None:
    """Return the page's path, whatever folder the script changes to. Raises OptionError for files that must not be written."""
    if out is None and (resume or (overwrite and report is None)):
        raise OptionError("--overwrite and --resume need an archive; name one: --out FILE.nc")
    output.check_outputs([model], archive=out, page=report, overwrite=overwrite)
    return report and report.absolute()


def _stack_up(path: Path) -> Dataset | None:
    """Return the stack-up of the archive of a model without parts, which is added to it; None for an assembly."""
    with open_unchecked(path) as results:
        if results.sizes["part"]:
            return None
        samples, seed = min(int(results.attrs["realizations"]), MAX_STACK), int(results.attrs["seed"])
    return tolcontact.analyses.stack_up(path, samples=samples, seed=seed, into=path)


def _summed_up(path: Path, until: str | None, report: Path | None) -> tuple[Summary, Dataset | None, str]:
    """Return the summary and the stack-up of the archive at a path, and what it lacks that `until` states; write its page."""
    stack = _stack_up(path)
    with open_unchecked(path) as results:
        summary = summarize(results)
        if report is not None:
            reports.write_page(results, summary, report)
        return summary, stack, Target.of(until).shortfall(results) if until is not None else ""


def _print_results(summary: Summary, stack: Dataset | None, out: Path | None, shortfall: str, *, quiet: bool) -> None:
    """Print the summary of results. Raises typer.Exit with code 1 if they lack something."""
    print_summary(summary)
    if stack is not None:
        typer.echo()
        output.console().print(reports.analysis_text(STACK_UP, stack))
    if out is not None:
        common.echo(f"\narchive: {out}")
    if shortfall:
        if quiet:  # otherwise the log has already stated it
            common.echo(shortfall, err=True)
        raise typer.Exit(1)


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
    are_archives = [path.suffix.lower() == ".nc" for path in inputs]
    if not all(are_archives) and len(inputs) > 1:
        raise OptionError(f"{', '.join(map(str, inputs))} are neither one model nor archives (.nc)")
    options = [name for name in MODEL_OPTIONS if name in common.set_options(context)]
    if all(are_archives) and options:
        raise OptionError(f"--{options[0]} applies to a model; archives have their own")
    if report is not None and not all(are_archives):
        raise OptionError("--report applies to archives; write an archive for each solver (run --out), and compare these")
    output.check_outputs(inputs, archive=out, page=report, overwrite=overwrite)
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
        output.print_data(comparison)
    else:
        output.console().print((reports.runs_text if all(are_archives) else reports.comparison_text)(comparison))
        if report is not None:
            common.echo(f"\nreport: {report}")


def _compare_archives(archives: Sequence[Path], report: Path | None) -> Dataset:
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
