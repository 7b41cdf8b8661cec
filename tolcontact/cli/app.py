"""The application: its commands, their shared options, and exit codes.

The module of a command is imported when the command is resolved, so `--help` imports none of them.
"""

import inspect
import shutil
import sys
import textwrap
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from tolcontact import cli, interrupts, shape_worker
from tolcontact.cli import analyses
from tolcontact.errors import OptionError, TolcontactError
from tolcontact.method import OBJECTIVES, RESOLUTIONS
from tolcontact.system import streams
from tolcontact.texts import shown
from tolcontact.version import __version__

if TYPE_CHECKING:
    from tolcontact.declaration import Assembly

MIN_COLUMNS = 40  # of a terminal: warnings are wrapped to no fewer
# The module of each command in this folder, and its line in the list of commands.
COMMANDS = {
    **{command.name: ("analysis_command", command.purpose) for command in analyses.COMMANDS},
    "summary": ("archives", "Print the statistics of an archive."),
    "report": ("archives", "Write a self-contained page for a browser from an archive, or a spreadsheet of its tables."),
    "compare": (
        "compare",
        "Compare solvers, resolutions or objectives of a model on the same draws, or archives with each other.",
    ),
    "new": ("models", "Write a small model with comments as a starting point."),
    "guide": ("models", "Open the installed guide in the browser: tutorials, how-tos, theory, reference, glossary."),
    "check": ("models", "Check a model and its options without a run; list all faults and probable mistakes."),
    "view": (
        "models",
        "Show an assembly before a run: faces, features with their tolerances, locators, contact points and nominal gaps.",
    ),
    "pmi": (
        "step_files",
        "List the tolerances, dimensions and datums of a STEP file of AP242, and how features declare them. In mm and rad.",
    ),
    "run": ("run", "Simulate a model with and without contact, and print the statistics of its measurements."),
    "bodies": (
        "step_files",
        "List the bodies of a STEP file in its product tree: numbers, names, sizes in mm, faces; and its units of length.",
    ),
    "faces": (
        "step_files",
        "List the faces of a body of a STEP file: numbers (tc.select.Brep), kinds, axes, radii, areas, slots, hole patterns.",
    ),
}


class Commands(TyperGroup):
    """The commands. A command that is stopped ends with a message."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = {name: TyperCommand(name, help=purpose) for name, (_, purpose) in COMMANDS.items()}

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name, command, arguments = super().resolve_command(ctx, args)
        shape_worker.start_early(arguments)
        return name, command and declared_command(str(name)), arguments

    def invoke(self, ctx: Any) -> Any:
        try:
            with interrupts.stoppable():
                return super().invoke(ctx)
        except KeyboardInterrupt:
            interrupts.end("stopped")
        finally:
            shape_worker.end_unused()


def declared_command(name: str) -> Any:
    """Return a command with its options. The module that declares the command is imported."""
    module, _ = COMMANDS[name]
    with interrupts.stoppable(at_once=True):  # in native modules that are being loaded an exception may be fatal
        getattr(cli, module)  # its import declares the command
    return next(
        typer.main.get_command_from_info(
            info, pretty_exceptions_short=app.pretty_exceptions_short, rich_markup_mode=app.rich_markup_mode
        )
        for info in app.registered_commands
        if name == (info.name or getattr(info.callback, "__name__", ""))
    )


app: typer.Typer = typer.Typer(
    cls=Commands,
    help="Tolerance analysis of rigid assemblies with contact resolved in every realization.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def echo(text: object, *, err: bool = False, nl: bool = True) -> None:
    """Print a text as a terminal may get it, whatever its letters are; tables are printed by a console."""
    typer.echo(shown(str(text)), err=err, nl=nl)


def flag(name: str, purpose: str, **settings: Any) -> Any:
    """Return an option without a value; an empty `metavar` hides the type in its help."""
    return typer.Option(name, metavar="", help=purpose, **settings)


def _show_version(is_set: bool) -> None:
    if is_set:
        echo(f"tolcontact {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[bool, flag("--version", "Show the version and exit.", callback=_show_version, is_eager=True)] = False,
) -> None:
    pass


def or_(names: Iterable[str]) -> str:
    """Return names as a list for a help text."""
    return ", ".join(f'"{name}"' if " " in name else name for name in names)


Model = Annotated[Path, typer.Argument(metavar="MODEL.py", help="Model script with a function assembly(), or a JSON model.")]
AnalysedModel = Annotated[
    Path, typer.Argument(metavar="MODEL.py|RUN.nc", help="Model script, JSON model, or the archive of a run, for its model.")
]
StepFile = Annotated[Path, typer.Argument(metavar="FILE.stp", help="STEP file.")]
Archive = Annotated[Path, typer.Argument(metavar="FILE.nc", help="Archive of a run.")]
Samples = Annotated[int, typer.Option(help="Number of realizations.")]
Seed = Annotated[int, typer.Option(help="Seed; the same seed gives the same realizations.")]
Solver = Annotated[str, typer.Option(help="QP solver: a conic plugin of CasADi, or graph.")]
Resolution = Annotated[
    str | None,
    typer.Option(help=f"One linear step, or steps until all gaps are open: {or_(RESOLUTIONS)}. Default: the model's."),
]
Objective = Annotated[
    str | None, typer.Option(help=f"Quantity that the pose with contact minimizes: {or_(OBJECTIVES)}. Default: the model's.")
]
AsJson = Annotated[bool, flag("--json", "Print the result as JSON.")]
AsCsv = Annotated[bool, flag("--csv", "Print the estimates as CSV.")]
Into = Annotated[Path | None, typer.Option(metavar="FILE.nc", help="Also store the result in an archive of the same model.")]
Overwrite = Annotated[bool, flag("--overwrite", "Replace existing netCDF files, pages and spreadsheets, whoever wrote them.")]
Workers = Annotated[int | None, typer.Option(metavar="N", help="Number of worker processes (with dask).")]
Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Simulate on the workers of a dask scheduler, such as tcp://host:8786.")
]
Minutes = Annotated[
    float | None, typer.Option(help="Time after which the answer so far is printed, which says so; so does Ctrl-C.")
]
Quiet = Annotated[bool, flag("--quiet", "Print results only: no progress, no notices.")]


def set_options(context: typer.Context) -> set[str]:
    """Return the parameters that the command line sets."""
    return {name for name in context.params if context.get_parameter_source(name).name == "COMMANDLINE"}  # type: ignore[union-attr]


def only_one(**options: bool) -> None:
    """Raise OptionError if several of these options are set."""
    names = [f"--{name}" for name, is_set in options.items() if is_set]
    if len(names) > 1:
        raise OptionError(f"{' and '.join(names)} exclude each other; choose one")


def examples(*commands: str) -> str:
    """Return the examples at the end of a help text, with one command per line."""
    return "Examples:\n\n" + "\n\n".join(f"tolcontact {command}" for command in commands)


def method_choices(**options: str | None) -> dict[str, str]:
    """Return the method choices that options set."""
    return {name: value for name, value in options.items() if value is not None}


def main(assembly: "Callable[[], Assembly]") -> None:
    """Run the script that defines `assembly`, with the options of `tolcontact run`: `tc.main(assembly)` ends a script."""
    script = inspect.getsourcefile(assembly)
    command_line([*(["run", script] if script else []), *sys.argv[1:]])


def command_line(arguments: list[str] | None = None) -> None:
    """Run `app` as the console script; an error prints one message and gives exit code 2."""
    streams.escape_unprintable()
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            app(arguments)
    except TolcontactError as error:
        echo(f"error: {error}", err=True)
        sys.exit(2)
    except (MemoryError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and "bad_alloc" not in str(error):  # CasADi's lack of memory
            raise
        remedy = "raise its limit (ulimit -v), or ask for fewer samples"
        echo(f"error: there is not enough memory ({str(error) or 'no details'}); {remedy}", err=True)
        sys.exit(2)
    except OSError as error:
        echo(f"error: the operating system reports: {error}", err=True)
        sys.exit(2)


def show_warnings(records: Iterable[warnings.WarningMessage]) -> None:
    """Print recorded warnings."""
    for record in records:
        _show_warning(record.message)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Print a warning, wrapped to the width of a terminal, or on one line elsewhere."""
    if sys.stderr is None:
        return
    text = f"warning: {shown(str(message))}"
    if sys.stderr.isatty():
        columns = max(shutil.get_terminal_size().columns, MIN_COLUMNS)
        text = textwrap.fill(text, columns, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    print(text, file=sys.stderr)  # a visible progress bar replaces this stream, and moves down
