"""tolcontact faces."""

import json
from dataclasses import asdict
from typing import Annotated

import typer

from tolcontact.cli.app import AsJson, StepFile, app, examples
from tolcontact.geometry import faces_in

Body = Annotated[str | None, typer.Option(help="Name or number of the body; a file with a single one needs none.")]


@app.command(epilog=examples("faces parts.stp --body lid"))
def faces(file: StepFile, body: Body = None, as_json: AsJson = False) -> None:
    """List the faces of a body of a STEP file: numbers (for tc.Brep), kinds, directions, radii, areas, and points on them."""
    found = faces_in(file, int(body) if body is not None and body.isdigit() else body)
    if as_json:
        typer.echo(json.dumps([asdict(face) for face in found]))
        return
    for face in found:
        typer.echo(face)
