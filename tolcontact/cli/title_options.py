"""Options that replace entries of the title block of a report."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from tolcontact.declaration import Assembly, TitleBlock
from tolcontact.declaration.script import load_model
from tolcontact.errors import shown

Title = Annotated[str | None, typer.Option(help="Title of the report. Default: the model's.", rich_help_panel="Title block")]
PartNumber = Annotated[str | None, typer.Option(help="Part number of the assembly.", rich_help_panel="Title block")]
Author = Annotated[str | None, typer.Option(help="Author of the report.", rich_help_panel="Title block")]
Revision = Annotated[str | None, typer.Option(help="Revision of the model or of its drawing.", rich_help_panel="Title block")]
Date = Annotated[str | None, typer.Option(help="Date of the report, as text.", rich_help_panel="Title block")]
Company = Annotated[str | None, typer.Option(help="Company that issues the report.", rich_help_panel="Title block")]
ENTRIES = tuple(TitleBlock().entries)  # in the order of these options


def title_entries(*options: str | None) -> dict[str, str | None]:
    """Return the entries of a title block by their names, from the options above in their order."""
    return dict(zip(ENTRIES, options, strict=True))


def note_kept_title(archive: Path | None, entries: Mapping[str, str | None]) -> None:
    """Print a note that a resumed archive keeps its title block, if the options state another one."""
    if archive is not None and archive.exists() and any(entries.values()):
        name = shown(str(archive))
        typer.echo(
            f"{name} keeps the title block that it was begun with; another one for its page: "
            f"tolcontact report {name} --title ...",
            err=True,
        )


def titled_model(path: Path, entries: Mapping[str, str | None]) -> Assembly:
    """Return the assembly that a file declares, with its title block updated by the `entries` that are not None."""
    assembly = load_model(path)
    if any(entry is not None for entry in entries.values()):
        assembly.title_block = (assembly.title_block or TitleBlock()).overridden(entries)
    return assembly
