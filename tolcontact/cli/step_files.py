"""tolcontact bodies, tolcontact faces."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated, Any

import typer

from tolcontact.cli.app import AsJson, StepFile, app, examples
from tolcontact.cli.progress import waiting
from tolcontact.errors import shown_name
from tolcontact.geometry import bodies_in, faces_in, group_lines

Body = Annotated[str | None, typer.Option(help="Name or number of the body. Not needed for a file with a single body.")]


@app.command(epilog=examples("bodies parts.stp"))
def bodies(file: StepFile, as_json: AsJson = False) -> None:
    """List the bodies of a STEP file in its product tree: numbers, names, sizes in mm, faces; and its units of length."""
    with waiting(f"reading {file}"):
        listing = bodies_in(file)
    if as_json:
        _print_rows(listing)
        return
    if listing and listing[0].units:
        typer.echo(f"lengths in the file: {listing[0].units}; here: mm, along x, y, z of the assembly")
    parents: tuple[str, ...] = ()
    for body in listing:
        *products, _ = body.path or ("",)
        for depth, name in enumerate(products):
            if parents[: depth + 1] != tuple(products[: depth + 1]):
                typer.echo(f"{'  ' * depth}{shown_name(name)}")
        parents = tuple(products)
        typer.echo(f"{'  ' * len(products)}{body}")


@app.command(epilog=examples("faces parts.stp --body lid"))
def faces(file: StepFile, body: Body = None, as_json: AsJson = False) -> None:
    """List the faces of a body of a STEP file: numbers (tc.select.Brep), kinds, axes, radii, areas, slots, hole patterns."""
    with waiting(f"reading {file}"):
        listing = faces_in(file, int(body) if body is not None and body.isdigit() else body)
    if as_json:
        _print_rows(listing)
        return
    for line in (*listing, *group_lines(listing)):
        typer.echo(line)


def _print_rows(rows: Sequence[Any]) -> None:
    typer.echo(json.dumps([asdict(row) for row in rows]))
