"""tolcontact view."""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from tolcontact.archive import open_archive
from tolcontact.cli.app import app, examples
from tolcontact.cli.output import check_page
from tolcontact.declaration import Assembly
from tolcontact.declaration.geometry import STEP
from tolcontact.declaration.script import load_model
from tolcontact.discretization import discretize
from tolcontact.errors import ModelError, shown
from tolcontact.geometry import parts_from
from tolcontact.report import write_page, write_view
from tolcontact.workflow.run import summarize


@app.command(epilog=examples("view model.py", "view parts.stp", "view model.py --out page.html"))
def view(
    source: Annotated[Path, typer.Argument(metavar="MODEL|FILE.nc|FILE.stp", help="A model, an archive, or a STEP file.")],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="Page to write. Default: a temporary page, opened in the browser."),
    ] = None,
) -> None:
    """Show an assembly before a run: faces with their selectors, locators, contact points and nominal gaps.

    The page lists the faults of a model. For an archive it is the report.
    """
    if out is not None:
        check_page(out)
    path = out or temporary_page(source)
    if source.suffix.lower() == ".nc":
        with open_archive(source) as results:
            write_page(results, summarize(results), path)
    elif source.suffix.lower() in STEP:
        model = Assembly(source.stem)
        parts_from(model, source)
        write_view(model, None, [], path)
    else:
        _write_model(load_model(source), path)
    typer.echo(f"page: {shown(str(path))}")
    if out is None:
        typer.launch(str(path))


def _write_model(model: Assembly, path: Path) -> None:
    try:
        nominal = discretize(model)
    except ModelError as error:
        write_view(model, None, error.faults, path)
    else:
        write_view(model, nominal, (), path)


def temporary_page(source: Path) -> Path:
    """Return the path of a new page in a temporary folder."""
    return Path(tempfile.mkdtemp(prefix="tolcontact-")) / f"{source.stem}.html"
