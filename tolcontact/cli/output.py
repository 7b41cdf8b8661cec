"""Output of results, checks of output files, and the options that replace entries of a title block of a report."""

import json
import math
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
import xarray as xr
from rich.console import Console

from tolcontact import report
from tolcontact.cli.app import echo
from tolcontact.declaration.title_block import TitleBlock
from tolcontact.errors import OptionError
from tolcontact.replacing import check_identities, folder_fault
from tolcontact.texts import csv_cell
from tolcontact.vocabulary import BY_STATUS, UNRESOLVED

if TYPE_CHECKING:
    import pandas as pd

FAILED_SHARE = 0.001
UNBOUNDED = 10_000  # columns outside a terminal
Title = Annotated[str | None, typer.Option(help="Title of the report. Default: the model's.", rich_help_panel="Title block")]
PartNumber = Annotated[str | None, typer.Option(help="Part number of the assembly.", rich_help_panel="Title block")]
Author = Annotated[str | None, typer.Option(help="Author of the report.", rich_help_panel="Title block")]
Revision = Annotated[str | None, typer.Option(help="Revision of the model or of its drawing.", rich_help_panel="Title block")]
Date = Annotated[str | None, typer.Option(help="Date of the report, as text.", rich_help_panel="Title block")]
Company = Annotated[str | None, typer.Option(help="Company that issues the report.", rich_help_panel="Title block")]
ENDINGS = {"comparison": (".nc",), "page": (".html", ".htm"), "spreadsheet": (".xlsx",)}
ENTRIES = tuple(TitleBlock().entries)  # in the order of these options


def console() -> Console:
    """Return a console on standard output; files and pipes have unlimited columns."""
    return Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else UNBOUNDED)


def check_outputs(
    inputs: Iterable[Path],
    *,
    archive: Path | None = None,
    comparison: Path | None = None,
    page: Path | None = None,
    spreadsheet: Path | None = None,
    overwrite: bool = False,
) -> None:
    """Raise OptionError unless a command may write its outputs: none is an input or another output, by whatever name.

    Pages of tolcontact are replaced; other pages, spreadsheets and comparisons only with `overwrite`. Archives are checked when
    they are locked.
    """
    named = {"archive": archive, "comparison": comparison, "page": page, "spreadsheet": spreadsheet}
    outputs = {name: path for name, path in named.items() if path is not None}
    check_identities(inputs, outputs)
    for name, path in outputs.items():
        if name == "archive":
            continue
        expected = ENDINGS[name]
        if path.suffix.lower() not in expected:
            raise OptionError(f'"{path}" is not the name of a {name}; expected one that ends in {expected[0]}')
        if fault := folder_fault(path):
            raise OptionError(f'{name} "{path}" cannot be written: {fault}')
        if not overwrite and path.exists() and not (name == "page" and report.is_page(path)):
            what = ", and is not a tolcontact page" if name == "page" else ""
            raise OptionError(f'"{path}" exists{what}; choose another name, or replace it with --overwrite')


def check_verdicts(summary: xr.Dataset) -> None:
    """Raise typer.Exit with code 1 if too many realizations of a run were not resolved.

    The same holds if a measurement with limits is not a number in some realizations.
    """
    failed = sum(int(summary[BY_STATUS.name][status]) for status in UNRESOLVED)
    if failed > FAILED_SHARE * summary.attrs["realizations"]:
        echo(f"error: {failed} realizations were not resolved, more than {FAILED_SHARE:.1%} of all", err=True)
    if failed > FAILED_SHARE * summary.attrs["realizations"] or report.has_no_verdict(summary):
        raise typer.Exit(1)


def print_data(dataset: xr.Dataset) -> None:
    """Print a dataset as JSON, which has no NaN or infinity: they are null, and the texts "Infinity" and "-Infinity"."""
    echo(json.dumps(_as_json(dataset.reset_coords().to_dict()), allow_nan=False, default=_plain))


def print_csv(frame: "pd.DataFrame") -> None:
    """Print a table as CSV, which a spreadsheet opens without running any text in it as a formula."""
    cells = frame.rename(index=csv_cell, columns=csv_cell).map(csv_cell)
    echo(cells.to_csv(lineterminator="\n"), nl=False)


def _as_json(value: object) -> object:
    """Return the value of a dataset's dictionary, with all that it holds, as print_data prints it."""
    if isinstance(value, dict):
        return {key: _as_json(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_as_json(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return value


def _plain(value: object) -> object:
    """Return a NumPy number as a JSON value."""
    return value.item() if isinstance(value, np.generic) else str(value)


def title_entries(*options: str | None) -> dict[str, str | None]:
    """Return the entries of a title block by their names, from the options above in their order."""
    return dict(zip(ENTRIES, options, strict=True))


def note_kept_title(archive: Path | None, entries: Mapping[str, str | None]) -> None:
    """Print a note that a resumed archive keeps its title block, if the options state another one."""
    if archive is not None and archive.exists() and any(entries.values()):
        echo(
            f"{archive} keeps the title block that it was begun with; another one for its page: "
            f"tolcontact report {archive} --title ...",
            err=True,
        )
