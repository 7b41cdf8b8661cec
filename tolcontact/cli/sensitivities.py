"""tolcontact sensitivities."""

import functools

import typer

from tolcontact.analyses.sensitivities import sensitivities as sensitivities_of
from tolcontact.cli.app import (
    AsCsv,
    AsJson,
    Into,
    Model,
    Objective,
    Quiet,
    Resolution,
    Samples,
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
from tolcontact.report import sensitivities_text
from tolcontact.simulation.cluster import client_of
from tolcontact.workflow.models import DEFAULT_SOLVER


@app.command(epilog=examples("sensitivities model.py", "sensitivities model.py --samples 200 --csv > slopes.csv"))
def sensitivities(
    model: Model,
    samples: Samples = 1000,
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
    """Print how much each measure follows each contributor, without contact and through it."""
    only_one(json=as_json, csv=as_csv)
    with shown_progress(model.stem, samples, quiet=quiet) as show, client_of(workers, scheduler) as client:
        found = sensitivities_of(
            functools.partial(load_model, model), samples=samples, seed=seed, solver=solver,
            method=chosen(resolution=resolution, objective=objective), into=into, client=client, progress=show,
        )  # fmt: skip
    if as_json:
        print_data(found)
    elif as_csv:
        values = found["sensitivity"].to_dataset("interval").to_dataframe()[["estimate", "lower", "upper"]]
        typer.echo(values.to_csv(lineterminator="\n"), nl=False)
    else:
        console().print(sensitivities_text(found))
