"""tolcontact allocate."""

import functools
from typing import Annotated

import typer

from tolcontact.analyses.allocate import VERIFICATIONS
from tolcontact.analyses.allocate import allocate as allocate_model
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
from tolcontact.errors import OptionError
from tolcontact.report import allocation_text
from tolcontact.simulation.cluster import client_of
from tolcontact.vocabulary import GROUPED_BY
from tolcontact.workflow.models import DEFAULT_SOLVER


@app.command(
    epilog=examples(
        'allocate model.py --require "gap: ppm 1000"',
        'allocate model.py --require "gap: Ppk 1.33" --by part --cost base=2 --cost top=1',
    )
)
def allocate(
    model: Model,
    require: Annotated[
        list[str], typer.Option(metavar="TEXT", help='What a measure must keep: "MEASURE: ppm 1000", "MEASURE: Ppk 1.33".')
    ],
    cost: Annotated[
        list[str] | None,
        typer.Option(
            metavar="GROUP=COST", help="What a group costs now; the cost grows as its ranges shrink. Default: 1 each."
        ),
    ] = None,
    by: Annotated[str, typer.Option(help=f"What is one group: {or_(GROUPED_BY)}.")] = "contributor",
    samples: Annotated[int, typer.Option(help="Number of realizations of each trial.")] = 8192,
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
    """Print tolerance ranges at least cost for what is required, and which to tighten first."""
    only_one(json=as_json, csv=as_csv)
    with shown_progress(model.stem, VERIFICATIONS, quiet=quiet) as show, client_of(workers, scheduler) as client:
        found = allocate_model(
            functools.partial(load_model, model), require, costs=dict(map(_cost, cost)) if cost else None, by=by,
            samples=samples, seed=seed, solver=solver, method=chosen(resolution=resolution, objective=objective),
            into=into, client=client, progress=show,
        )  # fmt: skip
    if as_json:
        print_data(found)
    elif as_csv:
        values = found[["range", "cost"]].to_dataframe().unstack("stage")
        values.columns = [" ".join(column) for column in values.columns]
        typer.echo(values.to_csv(lineterminator="\n"), nl=False)
    else:
        console().print(allocation_text(found))


def _cost(text: str) -> tuple[str, float]:
    name, _, value = text.rpartition("=")
    try:
        return name, float(value)
    except ValueError:
        raise OptionError(f'--cost is "{text}"; expected a group and a number, such as --cost top.A1=2') from None
