"""tolcontact check."""

from typing import Annotated

import typer

from tolcontact.cli.app import Model, Objective, Resolution, Seed, Solver, app, chosen, examples
from tolcontact.cli.output import console
from tolcontact.cli.view import show
from tolcontact.declaration.script import load_model
from tolcontact.report import population_text
from tolcontact.workflow.population import check_population
from tolcontact.workflow.run import DEFAULT_SOLVER, build


@app.command(epilog=examples("check model.py", "check model.py --view", "check model.py --population 1000"))
def check(
    model: Model,
    solver: Solver = DEFAULT_SOLVER,
    resolution: Resolution = None,
    objective: Objective = None,
    population: Annotated[
        int | None, typer.Option(metavar="N", help="Also draw N of every feature, and measure which share lies in its zones.")
    ] = None,
    seed: Seed = 1,
    view: Annotated[bool, typer.Option("--view", help="Also open the page of `tolcontact view`, with faults marked.")] = False,
) -> None:
    """Check a model, and these options, and list every fault; runs nothing."""
    if view:
        show(model, None)
    declared = load_model(model)
    program = build(declared, solver=solver, method=chosen(resolution=resolution, objective=objective))
    typer.echo(program.nominal.assembly)
    for part in program.nominal.parts:
        size = " x ".join(f"{length:.4g}" for length in part.mesh.extents)
        typer.echo(f"  part {part.name}: {size} mm, {len(part.mesh.faces)} triangles")
    for pair in program.nominal.pairs:
        typer.echo(f"  contact {pair.name}: {pair.in_words}")
    typer.echo("no faults found")
    if population is not None:
        console().print(population_text(check_population(declared, samples=population, seed=seed)))
