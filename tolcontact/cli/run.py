"""tolcontact run."""

import functools
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
from xarray import Dataset

import tolcontact
from tolcontact import report as reports
from tolcontact.archive import Run, open_unchecked
from tolcontact.cli import app as common, output
from tolcontact.cli.progress import shown_progress, stopped
from tolcontact.declaration import Assembly, TitleBlock
from tolcontact.declaration.script import load_model
from tolcontact.errors import OptionError
from tolcontact.realizations import archived_analysis
from tolcontact.simulation.cluster import client_of
from tolcontact.statistics import Summary
from tolcontact.temporary import temporary_folder
from tolcontact.vocabulary import KEPT, MONTE_CARLO, PLANS, STACK_UP
from tolcontact.workflow.accessor import summarize
from tolcontact.workflow.models import DEFAULT_SOLVER
from tolcontact.workflow.runs import SURFACES, Target, write_run

MAX_STACK = 100_000  # realizations of the table of a stack
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
            functools.partial(_titled_model, model, titles),
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
    """Return the stack-up of the archive of a model without parts, which holds it from then on; None for an assembly."""
    with open_unchecked(path) as results:
        if results.sizes["part"]:
            return None
        samples, seed = min(int(results.attrs["realizations"]), MAX_STACK), int(results.attrs["seed"])
        stored = archived_analysis(results, STACK_UP)
    if stored is not None and stored.attrs.get("realizations", 0) >= samples:
        return stored
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
    output.console().print(reports.summary_text(summary))
    if stack is not None:
        typer.echo()
        output.console().print(reports.analysis_text(STACK_UP, stack))
    if out is not None:
        common.echo(f"\narchive: {out}")
    if shortfall and quiet:  # otherwise the log has already stated it
        common.echo(shortfall, err=True)
    output.check_verdicts(summary)
    if shortfall:
        raise typer.Exit(1)


def _titled_model(path: Path, entries: Mapping[str, str | None]) -> Assembly:
    """Return the assembly that a file declares, with its title block updated by the `entries` that are not None."""
    assembly = load_model(path)
    if any(entry is not None for entry in entries.values()):
        assembly.title_block = (assembly.title_block or TitleBlock()).overridden(entries)
    return assembly
