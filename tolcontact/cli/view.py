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
    what: Annotated[Path, typer.Argument(metavar="MODEL|FILE.nc|FILE.stp", help="A model, an archive, or a STEP file.")],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="Only write the page. Default: a temporary one, opened in the browser."),
    ] = None,
) -> None:
    """Look at an assembly before any run: faces with the words that choose them, locators, contact points, nominal gaps.

    Faults of a model are listed on the page. Of an archive it is the report.
    """
    if out is not None:
        check_page(out)
    path = out or temporary(what)
    if what.suffix.lower() == ".nc":
        with open_archive(what) as results:
            write_page(results, summarize(results), path)
    elif what.suffix.lower() in STEP:
        model = Assembly(what.stem)
        parts_from(model, what)
        write_view(model, None, [], path)
    else:
        _write_model(load_model(what), path)
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


def temporary(of: Path) -> Path:
    """Where a page is written that is only looked at."""
    return Path(tempfile.mkdtemp(prefix="tolcontact-")) / f"{of.stem}.html"
