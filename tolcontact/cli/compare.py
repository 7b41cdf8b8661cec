"""tolcontact compare."""

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from tolcontact.archive import taken
from tolcontact.cli.app import Model, Samples, Seed, app, chosen, or_
from tolcontact.cli.output import console, print_data
from tolcontact.declaration.script import load_model
from tolcontact.method import OBJECTIVES, RESOLUTIONS
from tolcontact.report import comparison_text
from tolcontact.workflow.compare import compare as compare_solvers
from tolcontact.workflow.run import DEFAULT_SOLVER

_ONE_OR_MORE = "One or more of {}. Default: the model's."


@app.command()
def compare(
    model: Model,
    solvers: Annotated[
        str, typer.Option(help="Names of solvers, separated by commas; the first one is the reference.")
    ] = DEFAULT_SOLVER,
    samples: Samples = 1000,
    seed: Seed = 1,
    resolution: Annotated[str | None, typer.Option(help=_ONE_OR_MORE.format(or_(RESOLUTIONS)))] = None,
    objective: Annotated[str | None, typer.Option(help=_ONE_OR_MORE.format(or_(OBJECTIVES)))] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the comparison as JSON.")] = False,
    out: Annotated[Path | None, typer.Option(metavar="FILE.nc", help="Also write it to a new netCDF file.")] = None,
) -> None:
    """Compare solvers, resolutions or objectives on the same draws: agreement, failures, residuals, time."""
    methods = [chosen(resolution=one, objective=other) for one in _names(resolution) for other in _names(objective)]
    with contextlib.nullcontext() if out is None else taken(out) as path:
        found = compare_solvers(load_model(model), _listed(solvers), samples=samples, seed=seed, methods=methods)
        if path is not None:
            # Texts as characters: HDF5's texts of free length crash some versions of the netCDF library.
            texts = {name: {"dtype": "S1"} for name in found.variables if found[name].dtype.kind == "U"}
            found.to_netcdf(path, engine="netcdf4", encoding=texts)
    if as_json:
        print_data(found)
    else:
        console().print(comparison_text(found))


def _names(words: str | None) -> Sequence[str | None]:
    return [None] if words is None else _listed(words)


def _listed(words: str) -> list[str]:
    return [word.strip() for word in words.split(",") if word.strip()]
