"""Output of results, checks of output files, and the options that replace entries of a title block of a report."""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
import xarray as xr
from rich.console import Console

from tolcontact import report
from tolcontact.declaration import Assembly, TitleBlock
from tolcontact.declaration.script import load_model
from tolcontact.errors import OptionError, shown
from tolcontact.vocabulary import BY_STATUS, UNRESOLVED

FAILED_SHARE = 0.001
UNBOUNDED = 10_000  # columns outside a terminal
Title = Annotated[str | None, typer.Option(help="Title of the report. Default: the model's.", rich_help_panel="Title block")]
PartNumber = Annotated[str | None, typer.Option(help="Part number of the assembly.", rich_help_panel="Title block")]
Author = Annotated[str | None, typer.Option(help="Author of the report.", rich_help_panel="Title block")]
Revision = Annotated[str | None, typer.Option(help="Revision of the model or of its drawing.", rich_help_panel="Title block")]
Date = Annotated[str | None, typer.Option(help="Date of the report, as text.", rich_help_panel="Title block")]
Company = Annotated[str | None, typer.Option(help="Company that issues the report.", rich_help_panel="Title block")]
ENTRIES = tuple(TitleBlock().entries)  # in the order of these options


def console() -> Console:
    """Return a console on standard output; files and pipes have unlimited columns."""
    return Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else UNBOUNDED)


def check_page(path: Path, *, overwrite: bool = False) -> None:
    """Raise OptionError unless a page may be written to `path`: no other file is replaced without `overwrite`."""
    if path.suffix.lower() not in (".html", ".htm"):
        raise OptionError(f'"{path}" is not the name of a page; expected one that ends in .html')
    if not path.parent.is_dir():
        raise OptionError(f'page "{path}" cannot be written: there is no folder "{path.parent}"; make it first')
    if not overwrite and path.exists() and not report.is_page(path):
        raise OptionError(f'"{path}" exists, and is not a tolcontact page; choose another name, or replace it with --overwrite')


def check_spreadsheet(path: Path, *, overwrite: bool = False) -> None:
    """Raise OptionError unless a spreadsheet may be written to `path`: no file is replaced without `overwrite`."""
    if path.suffix.lower() != ".xlsx":
        raise OptionError(f'"{path}" is not the name of a spreadsheet; expected one that ends in .xlsx')
    if not path.parent.is_dir():
        raise OptionError(f'spreadsheet "{path}" cannot be written: there is no folder "{path.parent}"; make it first')
    if not overwrite and path.exists():
        raise OptionError(f'"{path}" exists; choose another name, or replace it with --overwrite')


def print_summary(summary: xr.Dataset) -> None:
    """Print the summary of a run. Raises typer.Exit with code 1 if too many realizations were not resolved."""
    console().print(report.summary_text(summary))
    failed = sum(int(summary[BY_STATUS.name][status]) for status in UNRESOLVED)
    if failed > FAILED_SHARE * summary.attrs["realizations"]:
        typer.echo(f"error: {failed} realizations were not resolved, more than {FAILED_SHARE:.1%} of all", err=True)
        raise typer.Exit(1)


def print_data(dataset: xr.Dataset) -> None:
    """Print a dataset as JSON, which has no NaN or infinity: they are null, and the texts "Infinity" and "-Infinity"."""
    data = dataset.reset_coords()
    numbers = {name: values.copy(data=_as_json(values.values)) for name, values in data.items() if values.dtype.kind == "f"}
    typer.echo(json.dumps(data.assign(numbers).to_dict(), allow_nan=False, default=_plain))


def _as_json(values: np.ndarray) -> np.ndarray:
    objects = values.astype(object)
    for word, places in ((None, np.isnan(values)), ("Infinity", values == np.inf), ("-Infinity", values == -np.inf)):
        objects[places] = word
    return objects


def _plain(value: object) -> object:
    """Return a NumPy number as a JSON value."""
    return value.item() if isinstance(value, np.generic) else str(value)


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
