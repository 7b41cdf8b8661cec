"""The group of all commands. A command's module is imported when the command is resolved, so `--help` imports none of them."""

from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from tolcontact import cli, interrupts, shape_worker
from tolcontact.cli import analyses

# The module of each command in this folder, and its line in the list of commands.
COMMANDS = {
    **{command.name: ("analysis_command", command.purpose) for command in analyses.COMMANDS},
    "summary": ("archives", "Print the statistics of an archive."),
    "report": (
        "archives",
        "Write a self-contained page for a browser from an archive, or a spreadsheet of its tables.",
    ),
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
    app = cli.app.app
    return next(
        typer.main.get_command_from_info(
            info, pretty_exceptions_short=app.pretty_exceptions_short, rich_markup_mode=app.rich_markup_mode
        )
        for info in app.registered_commands
        if name == (info.name or getattr(info.callback, "__name__", ""))
    )
