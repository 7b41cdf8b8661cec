"""The commands of all analyses: one table, for the list of commands and for their options."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tolcontact import vocabulary as terms
from tolcontact.errors import OptionError

if TYPE_CHECKING:
    import xarray as xr

CORNER = "X,Y,Z"
REQUIRED: Any = ...  # the default of an option without one
By = Annotated[str, typer.Option(help=f"How contributors are grouped: {', '.join(terms.GROUPED_BY)}.")]
Frame = Callable[["xr.Dataset"], Any]


@dataclass(frozen=True)
class AnalysisCommand:
    """A command for one analysis of a model.

    purpose    its line in the list of commands, and the beginning of its help text
    analysis   the name of its function in `tolcontact.analyses`
    samples    the meaning of the number of samples, for the help text; empty for an analysis without simulations
    frame      function that makes the data frame for --csv
    options    specific options by parameter: their typer annotations, and defaults
    arguments  function that makes the arguments of the analysis from these options, where they differ
    """

    name: str
    purpose: str
    analysis: str
    record: terms.AnalysisRecord
    samples: str
    examples: tuple[str, ...]
    frame: Frame
    options: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)
    arguments: Callable[[dict[str, Any]], dict[str, Any]] = lambda options: options


def _intervals(name: str) -> Frame:
    """Return a function for frames with the estimates of a variable, their intervals, and the units of labels as columns."""

    def frame(dataset: "xr.Dataset") -> Any:
        values = dataset[name].to_dataset("interval").to_dataframe()
        return values[[*terms.ESTIMATE, *(column for column in values if str(column).endswith("_units"))]]

    return frame


def _columns(names: list[str], dim: str) -> Frame:
    """Return a function for frames of variables, with a column for each label of a dimension."""

    def frame(dataset: "xr.Dataset") -> Any:
        values = dataset[names].to_dataframe().unstack(dim)
        values.columns = [" ".join(column) for column in values.columns]
        return values

    return frame


def _ranges(dataset: "xr.Dataset") -> Any:
    """Return the linear figures of a stack-up, and in rows of their own the simulated ranges with their intervals."""
    rows = [f"99.73 %, {word}" for word in terms.STATE_WORDS]
    values = dataset[["drawn", "centred", "half_width"]].reindex({terms.APPROACH: [*terms.APPROACHES, *rows]}).to_dataframe()
    simulated = dataset["simulated"].rename({terms.STATE: terms.APPROACH}).assign_coords({terms.APPROACH: rows})
    ends = simulated.to_series().unstack([terms.END, terms.INTERVAL])
    ends.columns = [" ".join(column) for column in ends.columns]
    return values.join(ends)


def _envelopes(dataset: "xr.Dataset") -> Any:
    """Return the envelopes of a sweep, with the share of realizations that are outside at any position."""
    shares = dataset["outside"].to_series().unstack(terms.INTERVAL).add_prefix("outside ")
    return _intervals("envelope")(dataset).join(shares)


def _trials(dataset: "xr.Dataset") -> Any:
    return dataset["tried"].to_pandas().assign(value=dataset["tried_value"].values).set_index("x")


def _with_costs(options: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of `allocate`."""
    costs = options.pop("cost")
    return options | {"costs": dict(map(_cost, costs)) if costs else None}


def _cost(text: str) -> tuple[str, float | dict[str | float, float]]:
    name, _, value = text.rpartition("=")
    try:
        if ":" not in value:
            return name, float(value)
        rows = [row.rpartition(":") for row in value.split(",")]
        return name, {key if key.startswith("IT") else float(key): float(cost) for key, _, cost in rows}
    except ValueError:
        raise OptionError(
            f'--cost is "{text}"; expected a group and a number, such as --cost top.A1=2, or costs of full widths or grades, '
            "such as --cost top.A1=0.1:4,0.2:2.5 or --cost pin.d.size=IT6:4,IT7:2.5"
        ) from None


def _with_corners(options: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of `relocate`."""
    corners = _corner(options.pop("from_corner"), "--from"), _corner(options.pop("to_corner"), "--to")
    return options | {"between": corners}


def _corner(text: str, option: str) -> tuple[float, ...]:
    try:
        return tuple(float(coordinate) for coordinate in text.split(","))
    except ValueError:
        raise OptionError(f'{option} is "{text}"; expected three numbers, such as 5,20,0') from None


def _with_points(options: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of `sweep`."""
    values = [_values(text) for text in options["over"]]
    for name, count in Counter(name for name, _ in values).items():
        if count > 1:
            raise OptionError(f'--over has "{name}" {count} times; give all its values at once, as in --over {name}=0,0.5,1')
    return options | {"over": dict(values)}


def _values(text: str) -> tuple[str, list[float]]:
    """Return the name and the values of a parameter; whole numbers remain whole."""
    name, _, value = text.partition("=")
    try:
        if not name:
            raise ValueError
        if ":" not in value:
            return name, list(map(_number, value.split(",")))
        first, last, count = value.split(":")
        start, end, steps = _number(first), _number(last), int(count) - 1
        if steps >= terms.MAX_POSITIONS:
            raise OptionError(f'--over is "{text}"; expected at most {terms.MAX_POSITIONS} positions')
        values = [start + (end - start) * k / (steps or 1) for k in range(steps + 1)]
        are_whole = isinstance(start + end, int)
        return name, [int(number) if are_whole and number.is_integer() else number for number in values]
    except (ValueError, OverflowError):
        raise OptionError(
            f'--over is "{text}"; expected --over angle=0:1.5:7 (from, to, number) or --over angle=0,0.5,1'
        ) from None


def _number(text: str) -> float:
    try:
        return int(text)
    except ValueError:
        return float(text)


COMMANDS = (
    AnalysisCommand(
        "stackup",
        "Print worst case, RSS, inflated RSS and Monte Carlo range of each measurement, in one table.",
        "stack_up",
        terms.STACK_UP,
        "Number of realizations.",
        ("stackup stack.py", "stackup run.nc --into run.nc"),
        _ranges,
    ),
    AnalysisCommand(
        "contributions",
        "Print the contributors that cause the variance of each measurement, with and without contact.",
        "contributions",
        terms.CONTRIBUTIONS,
        "Number of base realizations; each is simulated again for every group that matters. "
        "Default: 60 000 realizations in all, but 512 to 4096 base realizations.",
        ("contributions model.py", "contributions run.nc --by part", "contributions model.py --csv > shares.csv"),
        _columns(["first", "total"], "interval"),
        options={"by": (By, "contributor")},
    ),
    AnalysisCommand(
        "sensitivities",
        "Print how much each measurement changes with each contributor, with and without contact.",
        "sensitivities",
        terms.SENSITIVITIES,
        "Number of realizations.",
        ("sensitivities model.py", "sensitivities model.py --samples 200 --csv > slopes.csv"),
        _intervals("sensitivity"),
    ),
    AnalysisCommand(
        "tails",
        "Print rare-event (ppm) estimates: how often measurements are outside their limits, or parts cannot be assembled.",
        "tails",
        terms.TAILS,
        "Approximate number of realizations for each limit: by default and at least 30 000. "
        "Of 120 000 or more, a quarter is enough if it suffices.",
        ("tails model.py", "tails model.py --samples 400000 --json > rare.json"),
        _intervals("probability"),
    ),
    AnalysisCommand(
        "worst",
        "Print the worst-case minimum and maximum of each measurement, and the deviations that give them.",
        "worst_case",
        terms.WORST_CASE,
        "Number of random combinations; three searches for each extreme start for every 256 of them.",
        ("worst model.py", "worst model.py --samples 20000 --json > worst.json"),
        lambda dataset: dataset[["worst", "bound", "random", "agreeing", "ends", "unseen"]].to_dataframe(),
    ),
    AnalysisCommand(
        "allocate",
        "Print the tolerance ranges of least cost for what is required, and the ranges to tighten first.",
        "allocate",
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
                        metavar="GROUP=COST",
                        help="Present cost of a group; it grows as the ranges shrink. Default: 1 each. A table of costs offers "
                        "choices: pin.d.size=IT6:4,IT7:2.5 or base.A1=0.1:4,0.2:2.5.",
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
        "Print the position of a locator, within a box, at which a measurement varies least.",
        "relocate",
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
        "Print the least friction at which parts can be held short of their locators and seats, and what holds them.",
        "seating",
        terms.SEATING,
        "",
        ("seating model.py", "seating model.py --csv > friction.csv"),
        lambda dataset: dataset[["critical", "reserve"]].to_dataframe(),
    ),
    AnalysisCommand(
        "sweep",
        "Print the envelope of each measurement over the positions of a mechanism: the script's assembly(...) has parameters.",
        "sweep",
        terms.SWEEP,
        "Number of realizations, the same at all positions.",
        ("sweep hinge.py --over angle=0:1.5:7", "sweep slider.py --over slide=0,10,25 --over load=5,5,8 --csv > envelope.csv"),
        _envelopes,
        options={
            "model": (
                Annotated[
                    Path, typer.Argument(metavar="MODEL.py", help="Model script with a function assembly(...) of parameters.")
                ],
                REQUIRED,
            ),
            "over": (
                Annotated[
                    list[str],
                    typer.Option(metavar="NAME=VALUES", help="Values of a parameter: 0:1.5:7 (from, to, number) or 0,0.5,1."),
                ],
                REQUIRED,
            ),
        },
        arguments=_with_points,
    ),
)
