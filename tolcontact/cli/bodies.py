"""tolcontact bodies."""

import json
from dataclasses import asdict

import typer

from tolcontact.cli.app import AsJson, StepFile, app, examples
from tolcontact.errors import shown
from tolcontact.geometry import bodies_in


@app.command(epilog=examples("bodies parts.stp"))
def bodies(file: StepFile, as_json: AsJson = False) -> None:
    """List the bodies of a STEP file: numbers, names, sizes in mm and faces, in its product tree; and its units of length."""
    found = bodies_in(file)
    if as_json:
        typer.echo(json.dumps([asdict(body) for body in found]))
        return
    if found and found[0].units:
        typer.echo(f"lengths in the file: {found[0].units}; here: mm")
    above: tuple[str, ...] = ()
    for body in found:
        *products, _ = body.path or ("",)
        for depth, name in enumerate(products):
            if above[: depth + 1] != tuple(products[: depth + 1]):
                typer.echo(f"{'  ' * depth}{shown(name)}")
        above = tuple(products)
        typer.echo(f"{'  ' * len(products)}{body}")
