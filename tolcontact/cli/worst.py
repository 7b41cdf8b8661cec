"""tolcontact worst."""

import functools
from typing import Annotated

import typer

from tolcontact.analyses.worst_case import worst_case
from tolcontact.cli.app import (
    AsCsv,
    AsJson,
    Into,
    Model,
    Objective,
    Quiet,
    Resolution,
    Scheduler,
    Seed,
    Solver,
    Workers,
    app,
    chosen,
    examples,
    only_one,
)
from tolcontact.cli.output import console, print_data
from tolcontact.cli.progress import shown_progress
from tolcontact.declaration.script import load_model
from tolcontact.report import worst_case_text
from tolcontact.simulation.cluster import client_of
from tolcontact.workflow.models import DEFAULT_SOLVER


@app.command(epilog=examples("worst model.py", "worst model.py --samples 20000 --json > worst.json"))
def worst(
    model: Model,
    samples: Annotated[int, typer.Option(help="Number of random combinations; searches begin at the best of them.")] = 4096,
    seed: Seed = 1,
    solver: Solver = DEFAULT_SOLVER,
    resolution: Resolution = None,
    objective: Objective = None,
    as_json: AsJson = False,
    as_csv: AsCsv = False,
    into: Into = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    quiet: Quiet = False,
) -> None:
    """Print the least and the largest value of each measure that drawings allow, and what gives it."""
    only_one(json=as_json, csv=as_csv)
    with shown_progress(model.stem, 0, quiet=quiet) as show, client_of(workers, scheduler) as client:
        found = worst_case(
            functools.partial(load_model, model), samples=samples, seed=seed, solver=solver,
            method=chosen(resolution=resolution, objective=objective), into=into, client=client, progress=show,
        )  # fmt: skip
    if as_json:
        print_data(found)
    elif as_csv:
        values = found[["worst", "bound", "random", "ends", "unseen"]].drop_vars("measure_units").to_dataframe()
        typer.echo(values.to_csv(lineterminator="\n"), nl=False)
    else:
        console().print(worst_case_text(found))
