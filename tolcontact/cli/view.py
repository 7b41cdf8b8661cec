"""tolcontact view."""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from tolcontact.archive import open_archive
from tolcontact.cli.app import app, examples
from tolcontact.cli.output import check_page
from tolcontact.declaration import Assembly
from tolcontact.declaration.script import load_model
from tolcontact.discretization import discretize, parts_from
from tolcontact.errors import ModelError, shown
from tolcontact.report import write_page, write_view
from tolcontact.workflow.run import summarize

STEP = (".stp", ".step", ".p21")  # that the reader takes for STEP files


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
    show(what, out)


def show(what: Path, out: Path | None) -> None:
    """Write the page `out`; without it a temporary one, opened in the browser."""
    path = out or Path(tempfile.mkdtemp(prefix="tolcontact-")) / f"{what.stem}.html"
    if what.suffix.lower() == ".nc":
        with open_archive(what) as results:
            write_page(results, summarize(results), path)
    else:
        _write(what, path)
    typer.echo(f"page: {shown(str(path))}")
    if out is None:
        typer.launch(str(path))


def _write(what: Path, path: Path) -> None:
    if what.suffix.lower() in STEP:
        model = Assembly(what.stem)
        parts_from(model, what)
        write_view(model, None, [], path)
        return
    model = load_model(what)
    try:
        nominal, faults = discretize(model), ()
    except ModelError as error:
        write_view(model, None, error.faults, path)
    else:
        write_view(model, nominal, faults, path)
