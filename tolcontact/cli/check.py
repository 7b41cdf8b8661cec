"""tolcontact check."""

import typer

from tolcontact.cli.app import Model, Objective, Resolution, Solver, app, chosen
from tolcontact.declaration.script import load_model
from tolcontact.workflow.run import DEFAULT_SOLVER, build


@app.command()
def check(
    model: Model,
    solver: Solver = DEFAULT_SOLVER,
    resolution: Resolution = None,
    objective: Objective = None,
) -> None:
    """Check a model, and these options, and list every fault; runs nothing."""
    program = build(load_model(model), solver=solver, method=chosen(resolution=resolution, objective=objective))
    typer.echo(program.nominal.assembly)
    for part in program.nominal.parts:
        size = " x ".join(f"{length:.4g}" for length in part.mesh.extents)
        typer.echo(f"  part {part.name}: {size} mm, {len(part.mesh.faces)} triangles")
    for pair in program.nominal.pairs:
        typer.echo(f"  contact {pair.name}: {pair.in_words}")
    typer.echo("no faults found")
