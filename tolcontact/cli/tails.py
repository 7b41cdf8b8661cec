"""tolcontact tails."""

import functools
from typing import Annotated

import typer

from tolcontact.analyses.tails import tails as tails_of
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
from tolcontact.report import tails_text
from tolcontact.simulation.cluster import client_of
from tolcontact.workflow.models import DEFAULT_SOLVER


@app.command(epilog=examples("tails model.py", "tails model.py --samples 400000 --json > rare.json"))
def tails(
    model: Model,
    samples: Annotated[int, typer.Option(help="Number of realizations for each event, about.")] = 100_000,
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
    """Print how often measures are outside their limits, or parts do not go together, where that is rare."""
    only_one(json=as_json, csv=as_csv)
    with shown_progress(model.stem, samples, quiet=quiet) as show, client_of(workers, scheduler) as client:
        found = tails_of(
            functools.partial(load_model, model), samples=samples, seed=seed, solver=solver,
            method=chosen(resolution=resolution, objective=objective), into=into, client=client, progress=show,
        )  # fmt: skip
    if as_json:
        print_data(found)
    elif as_csv:
        values = found["probability"].to_dataset("interval").to_dataframe()[["estimate", "lower", "upper"]]
        typer.echo(values.to_csv(lineterminator="\n"), nl=False)
    else:
        console().print(tails_text(found))
