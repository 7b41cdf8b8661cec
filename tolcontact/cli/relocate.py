"""tolcontact relocate."""

import functools
from typing import Annotated

import typer

from tolcontact.analyses.relocate import relocate as relocate_locator
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
from tolcontact.errors import OptionError
from tolcontact.report import relocation_text
from tolcontact.simulation.cluster import client_of
from tolcontact.workflow.models import DEFAULT_SOLVER

CORNER = "X,Y,Z"


@app.command(
    epilog=examples(
        'relocate model.py --locator top.A3 --from 5,5,0 --to 45,20,0 --least "gap: 6 sigma"',
        'relocate model.py --locator top.A3 --from 5,5,0 --to 45,5,0 --least "gap: ppm"',
    )
)
def relocate(
    model: Model,
    locator: Annotated[str, typer.Option(help="The locator, as part.locator.")],
    one: Annotated[str, typer.Option("--from", metavar=CORNER, help="A corner of the region, in the part's own frame [mm].")],
    other: Annotated[str, typer.Option("--to", metavar=CORNER, help="The opposite corner.")],
    least: Annotated[str, typer.Option(metavar="TEXT", help='What is to be least: "MEASURE: 6 sigma", "MEASURE: ppm".')],
    samples: Annotated[int, typer.Option(help="Number of realizations of each trial.")] = 4096,
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
    """Print the place of a locator, within a region, where a measure varies least."""
    only_one(json=as_json, csv=as_csv)
    corners = _corner(one, "--from"), _corner(other, "--to")
    with shown_progress(model.stem, 1, quiet=quiet) as show, client_of(workers, scheduler) as client:
        found = relocate_locator(
            functools.partial(load_model, model), locator, between=corners, least=least, samples=samples, seed=seed,
            solver=solver, method=chosen(resolution=resolution, objective=objective), into=into, client=client, progress=show,
        )  # fmt: skip
    if as_json:
        print_data(found)
    elif as_csv:
        tried = found["tried"].to_pandas().assign(value=found["tried_value"].values)
        typer.echo(tried.to_csv(lineterminator="\n", index=False), nl=False)
    else:
        console().print(relocation_text(found))


def _corner(text: str, option: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise OptionError(f'{option} is "{text}"; expected three numbers, such as 5,20,0') from None
