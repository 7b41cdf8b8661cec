"""tolcontact check."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from tolcontact.cli.app import Model, Objective, Resolution, Seed, Solver, app, chosen, examples
from tolcontact.cli.output import console
from tolcontact.cli.view import temporary_page
from tolcontact.declaration import Assembly
from tolcontact.declaration.script import load_model
from tolcontact.discretization import Nominal
from tolcontact.errors import ModelError, shown
from tolcontact.report import population_text, write_view
from tolcontact.workflow.models import DEFAULT_SOLVER, build
from tolcontact.workflow.population_check import check_population


@app.command(epilog=examples("check model.py", "check model.py --view", "check model.py --population 1000"))
def check(
    model: Model,
    solver: Solver = DEFAULT_SOLVER,
    resolution: Resolution = None,
    objective: Objective = None,
    population: Annotated[
        int | None, typer.Option(metavar="N", help="Also draw every feature N times, and print the share inside its zones.")
    ] = None,
    seed: Seed = 1,
    view: Annotated[bool, typer.Option("--view", help="Also open the page of `tolcontact view`, with marked faults.")] = False,
) -> None:
    """Check a model and its options without a run, and list all faults."""
    assembly = load_model(model)
    try:
        program = build(assembly, solver=solver, method=chosen(resolution=resolution, objective=objective))
    except ModelError as error:
        if view:
            _open_view(assembly, None, error.faults, temporary_page(model))
        raise
    if view:
        _open_view(assembly, program.nominal, (), temporary_page(model))
    typer.echo(program.nominal.assembly)
    for part in program.nominal.parts:
        size = " x ".join(f"{length:.4g}" for length in part.mesh.extents)
        typer.echo(f"  part {part.name}: {size} mm, {len(part.mesh.faces)} triangles")
    for pair in program.nominal.pairs:
        typer.echo(f"  contact {pair.name}: {pair.in_words}")
    typer.echo("no faults found")
    if population is not None:
        console().print(population_text(check_population(assembly, samples=population, seed=seed)))


def _open_view(model: Assembly, nominal: Nominal | None, faults: Sequence[str], path: Path) -> None:
    """Write the view of a model, and open it in the browser."""
    write_view(model, nominal, faults, path)
    typer.echo(f"page: {shown(str(path))}")
    typer.launch(str(path))
