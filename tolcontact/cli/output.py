"""Results on standard output."""

import json
import sys
from pathlib import Path

import numpy as np
import typer
import xarray as xr
from rich.console import Console

from tolcontact.errors import OptionError
from tolcontact.report import summary_text
from tolcontact.vocabulary import UNRESOLVED

FAILED_SHARE = 0.001
UNBOUNDED = 10_000  # columns of what is not a terminal


def console() -> Console:
    """Standard output; what is not a terminal is never cut."""
    return Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else UNBOUNDED)


def print_data(found: xr.Dataset) -> None:
    """Print a dataset as JSON, which has no NaN and no infinity: what is not a number is null."""
    data = found.reset_coords()
    finite = {name: of.astype(object).where(np.isfinite(of), None) for name, of in data.items() if of.dtype.kind == "f"}
    typer.echo(json.dumps(data.assign(finite).to_dict(), allow_nan=False, default=_plain))


def _plain(value: object) -> object:
    """What JSON has of a number of NumPy."""
    return value.item() if isinstance(value, np.generic) else str(value)


def check_page(path: Path) -> None:
    """Raise OptionError unless a page may be written there; what is no page is never replaced."""
    if path.suffix.lower() not in (".html", ".htm"):
        raise OptionError(f'"{path}" is not the name of a page; expected one that ends in .html')
    if not path.parent.is_dir():
        raise OptionError(f'page "{path}" cannot be written: there is no folder "{path.parent}"; make it first')


def print_summary(found: xr.Dataset) -> None:
    """Print the summary of a run. Ends with exit code 1 if too many realizations were not resolved."""
    console().print(summary_text(found))
    failed = sum(int(found["by_status"][status]) for status in UNRESOLVED)
    if failed > FAILED_SHARE * found.attrs["realizations"]:
        typer.echo(f"error: {failed} realizations were not resolved, more than {FAILED_SHARE:.1%} of all", err=True)
        raise typer.Exit(1)
