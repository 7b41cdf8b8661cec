"""tolcontact report."""

from pathlib import Path
from typing import Annotated

import typer

from tolcontact.archive import open_archive
from tolcontact.cli.app import Archive, app, examples
from tolcontact.cli.output import check_page
from tolcontact.errors import shown
from tolcontact.report import write_page
from tolcontact.workflow.run import summarize


@app.command(epilog=examples("report run.nc", "report run.nc --out page.html"))
def report(
    archive: Archive,
    out: Annotated[Path | None, typer.Option(metavar="FILE.html", help="The page. Default: beside the archive.")] = None,
) -> None:
    """Write what an archive holds as one page to look at, which needs no network."""
    path = out or Path(archive).with_suffix(".html")
    check_page(path)
    with open_archive(archive) as results:
        write_page(results, summarize(results), path)
    typer.echo(f"report: {shown(str(path))}")
