"""The commands of all analyses, from one table: shared options are declared once."""

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.allocate import allocate
from tolcontact.analyses.contributions import contributions
from tolcontact.analyses.relocate import relocate
from tolcontact.analyses.seating import seating
from tolcontact.analyses.sensitivities import sensitivities
from tolcontact.analyses.tails import tails
from tolcontact.analyses.worst_case import worst_case
from tolcontact.archive import open_archive
from tolcontact.cli import app as common, commands
from tolcontact.cli.json_output import print_data
from tolcontact.cli.output import console
from tolcontact.cli.progress import shown_progress
from tolcontact.errors import OptionError
from tolcontact.report.text import analysis_text
from tolcontact.simulation.cluster import client_of
from tolcontact.workflow.models import DEFAULT_SOLVER, is_archive

SHARED = {  # options of analyses, with their defaults, and the argument of an analysis that an option needs
    "seed": (common.Seed, 1, "seed"), "solver": (common.Solver, DEFAULT_SOLVER, "solver"),
    "resolution": (common.Resolution, None, "method"), "objective": (common.Objective, None, "method"),
    "as_json": (common.AsJson, False, "model"), "as_csv": (common.AsCsv, False, "model"), "into": (common.Into, None, "into"),
    "workers": (common.Workers, None, "client"), "scheduler": (common.Scheduler, None, "client"),
    "quiet": (common.Quiet, False, "progress"),
}  # fmt: skip
CORNER = "X,Y,Z"
REQUIRED = inspect.Parameter.empty
By = Annotated[str, typer.Option(help=f"How contributors are grouped: {common.or_(terms.GROUPED_BY)}.")]
Frame = Callable[[xr.Dataset], Any]


@dataclass(frozen=True)
class AnalysisCommand:
    """A command for one analysis of a model.

    samples    the meaning of the number of samples, for the help text; empty for an analysis without simulations
    frame      function that makes the data frame for --csv
    options    specific options by parameter: their typer annotations, and defaults (REQUIRED: none)
    arguments  function that makes the arguments of the analysis from these options, where they differ
    """

    name: str
    analysis: Callable[..., xr.Dataset]
    record: terms.AnalysisRecord
    samples: str
    examples: tuple[str, ...]
    frame: Frame
    options: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)
    arguments: Callable[[dict[str, Any]], dict[str, Any]] = lambda options: options

    def register(self) -> None:
        """Add the command to the application."""
        options = {
            "context": (typer.Context, REQUIRED),
            "model": (common.AnalysedModel, REQUIRED),
            **self.options,
            **self._samples,
            **{
                name: (annotation, default)
                for name, (annotation, default, needed) in SHARED.items()
                if needed in self._parameters
            },
        }
        command = functools.partial(self._run)
        command.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [
                inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)
                for name, (annotation, default) in options.items()
            ]
        )
        command.__annotations__ = {}  # type: ignore[attr-defined]
        common.app.command(self.name, help=commands.COMMANDS[self.name][1], epilog=common.examples(*self.examples))(command)

    @property
    def _parameters(self) -> Mapping[str, inspect.Parameter]:
        return inspect.signature(self.analysis).parameters

    @property
    def _samples(self) -> dict[str, tuple[Any, Any]]:
        """The option of the number of samples, if there is one."""
        if not self.samples:
            return {}
        default = self._parameters["samples"].default
        kind = int if default is not None else int | None
        return {"samples": (Annotated[kind, typer.Option(help=self.samples)], default)}  # type: ignore[valid-type]

    def _run(
        self, *, context: typer.Context, model: Path, as_json: bool, as_csv: bool, resolution: str | None = None,
        objective: str | None = None, workers: int | None = None, scheduler: str | None = None, quiet: bool = True,
        **options: Any,
    ) -> None:  # fmt: skip
        common.only_one(json=as_json, csv=as_csv)
        if is_archive(model):
            options |= {name: value for name, value in _settings_of_run(model, context).items() if name in self._parameters}
        arguments = self.arguments(options)
        with shown_progress(model.stem, 1, quiet=quiet) as show, client_of(workers, scheduler) as client:
            method = common.method_choices(resolution=resolution, objective=objective)
            shared = {"method": method, "client": client, "progress": show}
            arguments |= {name: value for name, value in shared.items() if name in self._parameters}
            dataset = self.analysis(model, **arguments)
        if as_json:
            print_data(dataset)
        elif as_csv:
            typer.echo(self.frame(dataset).to_csv(lineterminator="\n"), nl=False)
        else:
            console().print(analysis_text(self.record, dataset))
        if "met" in dataset and not dataset["met"].all():
            names = ", ".join(f'"{name}"' for name in dataset["requirement"].values[dataset["met"].values == 0])
            typer.echo(f"error: not met: {names}", err=True)
            raise typer.Exit(1)


def _settings_of_run(archive: Path, context: typer.Context) -> dict[str, Any]:
    """Return the seed and the solver of an archive's run, unless options of the command line replace them."""
    with open_archive(archive) as results:
        settings = {"seed": int(results.attrs["seed"]), "solver": str(results.attrs["solver"])}
    return {name: value for name, value in settings.items() if name not in common.set_options(context)}


def _intervals(name: str) -> Frame:
    """Return a function for frames with the estimates of a variable, their intervals, and the units of labels as columns."""

    def frame(dataset: xr.Dataset) -> Any:
        values = dataset[name].to_dataset("interval").to_dataframe()
        return values[[*terms.ESTIMATE, *(column for column in values if str(column).endswith("_units"))]]

    return frame


def _columns(names: list[str], dim: str) -> Frame:
    """Return a function for frames of variables, with a column for each label of a dimension."""

    def frame(dataset: xr.Dataset) -> Any:
        values = dataset[names].to_dataframe().unstack(dim)
        values.columns = [" ".join(column) for column in values.columns]
        return values

    return frame


def _trials(dataset: xr.Dataset) -> Any:
    return dataset["tried"].to_pandas().assign(value=dataset["tried_value"].values).set_index("x")


def _with_costs(options: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of `allocate`."""
    costs = options.pop("cost")
    return options | {"costs": dict(map(_cost, costs)) if costs else None}


def _cost(text: str) -> tuple[str, float]:
    name, _, value = text.rpartition("=")
    try:
        return name, float(value)
    except ValueError:
        raise OptionError(f'--cost is "{text}"; expected a group and a number, such as --cost top.A1=2') from None


def _with_corners(options: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of `relocate`."""
    corners = _corner(options.pop("from_corner"), "--from"), _corner(options.pop("to_corner"), "--to")
    return options | {"between": corners}


def _corner(text: str, option: str) -> tuple[float, ...]:
    try:
        return tuple(float(coordinate) for coordinate in text.split(","))
    except ValueError:
        raise OptionError(f'{option} is "{text}"; expected three numbers, such as 5,20,0') from None


COMMANDS = (
    AnalysisCommand(
        "contributions",
        contributions,
        terms.CONTRIBUTIONS,
        "Number of base realizations; each is simulated again for every group that matters. "
        "Default: 60 000 realizations in all, but 512 to 4096 base realizations.",
        ("contributions model.py", "contributions run.nc --by part", "contributions model.py --csv > shares.csv"),
        _columns(["first", "total"], "interval"),
        options={"by": (By, "contributor")},
    ),
    AnalysisCommand(
        "sensitivities",
        sensitivities,
        terms.SENSITIVITIES,
        "Number of realizations.",
        ("sensitivities model.py", "sensitivities model.py --samples 200 --csv > slopes.csv"),
        _intervals("sensitivity"),
    ),
    AnalysisCommand(
        "tails",
        tails,
        terms.TAILS,
        "Approximate largest number of realizations for each event; by default all events share 60 000. "
        "The analysis stops at a quarter of them if these suffice.",
        ("tails model.py", "tails model.py --samples 400000 --json > rare.json"),
        _intervals("probability"),
    ),
    AnalysisCommand(
        "worst",
        worst_case,
        terms.WORST_CASE,
        "Number of random combinations; three searches for each extreme start for every 256 of them.",
        ("worst model.py", "worst model.py --samples 20000 --json > worst.json"),
        lambda dataset: dataset[["worst", "bound", "random", "agreeing", "ends", "unseen"]].to_dataframe(),
    ),
    AnalysisCommand(
        "allocate",
        allocate,
        terms.ALLOCATION,
        "Number of realizations of each trial.",
        (
            'allocate model.py --require "gap: ppm 1000"',
            'allocate model.py --require "gap: Ppk 1.33" --by part --cost base=2 --cost top=1',
        ),
        _columns(["range", "cost"], "stage"),
        options={
            "require": (
                Annotated[
                    list[str],
                    typer.Option(
                        metavar="TEXT", help='Requirement on a measurement: "MEASURE: ppm 1000", "MEASURE: Ppk 1.33".'
                    ),
                ],
                REQUIRED,
            ),
            "cost": (
                Annotated[
                    list[str] | None,
                    typer.Option(
                        metavar="GROUP=COST", help="Present cost of a group; it grows as the ranges shrink. Default: 1 each."
                    ),
                ],
                None,
            ),
            "by": (By, "contributor"),
        },
        arguments=_with_costs,
    ),
    AnalysisCommand(
        "relocate",
        relocate,
        terms.RELOCATION,
        "Number of realizations of each trial.",
        (
            'relocate model.py --locator top.A3 --from 5,5,0 --to 45,20,0 --least "gap: 6 sigma"',
            'relocate model.py --locator top.A3 --from 5,5,0 --to 45,5,0 --least "gap: ppm"',
        ),
        _trials,
        options={
            "locator": (Annotated[str, typer.Option(help="The locator, as part.locator.")], REQUIRED),
            "from_corner": (
                Annotated[
                    str, typer.Option("--from", metavar=CORNER, help="A corner of the box, in mm in the part's own frame.")
                ],
                REQUIRED,
            ),
            "to_corner": (Annotated[str, typer.Option("--to", metavar=CORNER, help="The opposite corner.")], REQUIRED),
            "least": (
                Annotated[str, typer.Option(metavar="TEXT", help='Statistic to minimize: "MEASURE: 6 sigma", "MEASURE: ppm".')],
                REQUIRED,
            ),
        },
        arguments=_with_corners,
    ),
    AnalysisCommand(
        "seating",
        seating,
        terms.SEATING,
        "",
        ("seating model.py", "seating model.py --csv > friction.csv"),
        lambda dataset: dataset[["critical", "reserve"]].to_dataframe(),
    ),
)
for _command in COMMANDS:
    _command.register()
