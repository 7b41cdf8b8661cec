"""tolcontact summary, tolcontact report."""

from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from tolcontact import archive as archives, report as reports, workflow
from tolcontact.cli.app import Archive, AsCsv, AsJson, Overwrite, app, echo, examples, flag, only_one
from tolcontact.cli.output import (
    Author,
    Company,
    Date,
    PartNumber,
    Revision,
    Title,
    check_outputs,
    check_verdicts,
    console,
    print_csv,
    print_data,
    title_entries,
)
from tolcontact.cli.progress import waiting
from tolcontact.declaration.title_block import title_block_of
from tolcontact.vocabulary import ESTIMATE, MEASURE_UNITS, STATISTIC, units_of


@app.command(
    epilog=examples("summary run.nc", "summary run.nc --limits", "summary run.nc --all", "summary run.nc --csv > run.csv")
)
def summary(
    archive: Archive,
    as_json: AsJson = False,
    as_csv: AsCsv = False,
    limits: Annotated[bool, flag("--limits", "Print only shares out of specification, and capability.")] = False,
    whole: Annotated[bool, flag("--all", "Print all figures of all measurements, parts and pairs, also of many.")] = False,
) -> None:
    """Print the statistics of an archive.

    The exit code is 1 if more than 0.1 % of the realizations were not resolved (not converged, not assemblable, or doubtful),
    and if a measurement with limits is not a number in some.
    """
    only_one(json=as_json, csv=as_csv, limits=limits, all=whole)
    estimates = workflow.summarize(archive)
    if as_csv:
        values = estimates["statistic_value"].to_dataset("interval").to_dataframe()
        names = values.index.get_level_values(STATISTIC)
        values["units"] = [units_of(*labels) for labels in zip(names, values[MEASURE_UNITS.name], strict=True)]
        print_csv(values[[*ESTIMATE, "units"]])
    elif as_json:
        print_data(estimates)
    elif limits:
        console().print(reports.capability_text(estimates))
    else:
        console().print(reports.summary_text(estimates, is_whole=whole))
    check_verdicts(estimates)


@app.command(epilog=examples("report run.nc", "report run.nc --out page.html", "report run.nc --xlsx tables.xlsx"))
def report(
    archive: Archive,
    out: Annotated[Path | None, typer.Option(metavar="FILE.html", help="Page to write. Default: next to the archive.")] = None,
    xlsx: Annotated[
        Path | None,
        typer.Option(metavar="FILE.xlsx", help="Spreadsheet of the tables; the page is then written only with --out."),
    ] = None,
    title: Title = None,
    part_number: PartNumber = None,
    author: Author = None,
    revision: Revision = None,
    date: Date = None,
    company: Company = None,
    overwrite: Overwrite = False,
) -> None:
    """Write a self-contained page for a browser from an archive, or a spreadsheet of its tables."""
    page = out if out or xlsx else Path(archive).with_suffix(".html")
    check_outputs([archive], page=page, spreadsheet=xlsx, overwrite=overwrite)
    entries = title_entries(title, part_number, author, revision, date, company)
    with waiting(f"writing the report of {archive}"), archives.open_archive(archive) as results:
        summary, titles = workflow.summarize(results), title_block_of(results.attrs).overridden(entries)
        if page is not None:
            reports.write_page(  # few reports need the model, and all that it takes to build it
                results, summary, page, titles,
                lambda: import_module("tolcontact.analyses.rebuilt").first_order_variances(results),
                lambda: import_module("tolcontact.analyses.rebuilt").rigid_values(results),
            )  # fmt: skip
        if xlsx is not None:
            reports.write_spreadsheet(results, summary, xlsx, titles)
    for kind, path in (("report", page), ("spreadsheet", xlsx)):
        if path is not None:
            echo(f"{kind}: {path}")
