"""tolcontact contributions."""

import functools
from typing import Annotated

import typer

from tolcontact.analyses.contributions import contributions as contributions_of
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
    or_,
)
from tolcontact.cli.output import console, print_data
from tolcontact.cli.progress import shown_progress
from tolcontact.declaration.script import load_model
from tolcontact.report import contributions_text
from tolcontact.simulation.cluster import client_of
from tolcontact.vocabulary import GROUPED_BY
from tolcontact.workflow.models import DEFAULT_SOLVER


@app.command(
    epilog=examples("contributions model.py", "contributions model.py --by part", "contributions model.py --csv > shares.csv")
)
def contributions(
    model: Model,
    samples: Annotated[int, typer.Option(help="Number of base realizations; each is simulated again for every group.")] = 4096,
    seed: Seed = 1,
    solver: Solver = DEFAULT_SOLVER,
    resolution: Resolution = None,
    objective: Objective = None,
    by: Annotated[str, typer.Option(help=f"What is one group: {or_(GROUPED_BY)}.")] = "contributor",
    as_json: AsJson = False,
    as_csv: AsCsv = False,
    into: Into = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    quiet: Quiet = False,
) -> None:
    """Print which contributors the variance of each measure comes from, without contact and with it."""
    only_one(json=as_json, csv=as_csv)
    with shown_progress(model.stem, samples, quiet=quiet) as show, client_of(workers, scheduler) as client:
        found = contributions_of(
            functools.partial(load_model, model), samples=samples, seed=seed, solver=solver,
            method=chosen(resolution=resolution, objective=objective), by=by, into=into, client=client, progress=show,
        )  # fmt: skip
    if as_json:
        print_data(found)
    elif as_csv:
        values = found[["first", "total"]].to_dataframe().unstack("interval")
        values.columns = [" ".join(column) for column in values.columns]
        typer.echo(values.to_csv(lineterminator="\n"), nl=False)
    else:
        console().print(contributions_text(found))
