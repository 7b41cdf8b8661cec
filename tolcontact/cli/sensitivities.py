"""tolcontact sensitivities."""

import functools
from typing import Annotated

import typer

from tolcontact.cli.app import Model, Objective, Resolution, Samples, Seed, Solver, app, chosen, examples
from tolcontact.cli.output import console, print_data
from tolcontact.cli.progress import shown_progress
from tolcontact.declaration.script import load_model
from tolcontact.errors import OptionError
from tolcontact.report import sensitivities_text
from tolcontact.workflow.run import DEFAULT_SOLVER
from tolcontact.workflow.sensitivities import sensitivities as sensitivities_of


@app.command(epilog=examples("sensitivities model.py", "sensitivities model.py --samples 200 --csv > slopes.csv"))
def sensitivities(
    model: Model,
    samples: Samples = 1000,
    seed: Seed = 1,
    solver: Solver = DEFAULT_SOLVER,
    resolution: Resolution = None,
    objective: Objective = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print them as JSON.")] = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print the mean derivatives as CSV.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress and no notices.")] = False,
) -> None:
    """Print how much each measure follows each contributor, without contact and through it."""
    if as_json and as_csv:
        raise OptionError("--json and --csv are given; choose one")
    with shown_progress(model.stem, samples, quiet=quiet) as show:
        found = sensitivities_of(
            functools.partial(load_model, model), samples=samples, seed=seed, solver=solver,
            method=chosen(resolution=resolution, objective=objective), progress=show,
        )  # fmt: skip
    if as_json:
        print_data(found)
    elif as_csv:
        values = found["sensitivity"].to_dataset("interval").to_dataframe()[["estimate", "lower", "upper"]]
        typer.echo(values.to_csv(lineterminator="\n"), nl=False)
    else:
        console().print(sensitivities_text(found))
