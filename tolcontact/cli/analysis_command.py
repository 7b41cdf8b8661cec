"""The commands of `cli.analyses`: shared options are declared once."""

import functools
import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from tolcontact import analyses, interrupts
from tolcontact.archive import open_archive
from tolcontact.cli import app as common
from tolcontact.cli.analyses import COMMANDS, REQUIRED, AnalysisCommand
from tolcontact.cli.output import console, print_csv, print_data
from tolcontact.cli.progress import shown_progress
from tolcontact.input_files import is_archive
from tolcontact.report import analysis_text
from tolcontact.simulation.cluster import client_of
from tolcontact.workflow.models import DEFAULT_SOLVER

SHARED = {  # options of analyses, with their defaults, and the argument of an analysis that an option needs
    "seed": (common.Seed, 1, "seed"), "solver": (common.Solver, DEFAULT_SOLVER, "solver"),
    "resolution": (common.Resolution, None, "method"), "objective": (common.Objective, None, "method"),
    "as_json": (common.AsJson, False, "model"), "as_csv": (common.AsCsv, False, "model"), "into": (common.Into, None, "into"),
    "workers": (common.Workers, None, "client"), "scheduler": (common.Scheduler, None, "client"),
    "minutes": (common.Minutes, None, "minutes"), "quiet": (common.Quiet, False, "progress"),
}  # fmt: skip


def register(command: AnalysisCommand) -> None:
    """Add a command to the application."""
    parameters = inspect.signature(getattr(analyses, command.analysis)).parameters
    options = {
        "context": (typer.Context, REQUIRED),
        "model": (common.AnalysedModel, REQUIRED),
        **command.options,
        **({"samples": _samples(command, parameters)} if command.samples else {}),
        **{name: entry[:2] for name, entry in SHARED.items() if entry[2] in parameters},
    }
    function = functools.partial(_run, command, parameters)
    function.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation,
                default=inspect.Parameter.empty if default is REQUIRED else default,
            )
            for name, (annotation, default) in options.items()
        ]
    )  # fmt: skip
    function.__annotations__ = {}  # type: ignore[attr-defined]
    common.app.command(command.name, help=command.purpose, epilog=common.examples(*command.examples))(function)


def _samples(command: AnalysisCommand, parameters: Mapping[str, inspect.Parameter]) -> tuple[Any, Any]:
    default = parameters["samples"].default
    kind = int if default is not None else int | None
    return Annotated[kind, typer.Option(help=command.samples)], default  # type: ignore[valid-type]


def _run(
    command: AnalysisCommand, parameters: Mapping[str, inspect.Parameter], *, context: typer.Context, model: Path,
    as_json: bool, as_csv: bool, resolution: str | None = None, objective: str | None = None, workers: int | None = None,
    scheduler: str | None = None, quiet: bool = True, **options: Any,
) -> None:  # fmt: skip
    common.only_one(json=as_json, csv=as_csv)
    if is_archive(model):
        options |= {name: value for name, value in _settings_of_run(model, context).items() if name in parameters}
    arguments = command.arguments(options)
    with shown_progress(model.stem, 1, quiet=quiet) as show, client_of(workers, scheduler) as client:
        method = common.method_choices(resolution=resolution, objective=objective)
        shared = {"method": method, "client": client, "progress": show}
        arguments |= {name: value for name, value in shared.items() if name in parameters}
        stopped = ""
        try:
            dataset = getattr(analyses, command.analysis)(model, **arguments)
        except analyses.Stopped as stop:
            dataset, stopped = stop.dataset, str(stop)
    if as_json:
        print_data(dataset)
    elif as_csv:
        print_csv(command.frame(dataset))
    else:
        console().print(analysis_text(command.record, dataset))
    if stopped:
        interrupts.end(stopped)
    if "met" in dataset and not dataset["met"].all():
        names = ", ".join(f'"{name}"' for name in dataset["requirement"].values[dataset["met"].values == 0])
        common.echo(f"error: not met: {names}", err=True)
        raise typer.Exit(1)


def _settings_of_run(archive: Path, context: typer.Context) -> dict[str, Any]:
    """Return the seed and the solver of an archive's run, unless options of the command line replace them."""
    with open_archive(archive) as results:
        settings = {"seed": int(results.attrs["seed"]), "solver": str(results.attrs["solver"])}
    return {name: value for name, value in settings.items() if name not in common.set_options(context)}


for _command in COMMANDS:
    register(_command)
