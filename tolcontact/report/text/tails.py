"""Rare events for the terminal."""

from collections.abc import Iterator

import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact.report.figures import grouped
from tolcontact.report.text.table import FigureTable

TAIL_COLUMNS = ("", "ppm")


def tails_text(found: xr.Dataset) -> Group:
    """Rare events (see tolcontact.analyses.tails) as something that rich prints."""
    return Group(*_sections(found))


def _sections(found: xr.Dataset) -> Iterator[Text | FigureTable]:
    simulated = int(found["simulated"].sum())
    yield Text(f"{found.attrs['title']}: {grouped(simulated)} realizations", style="bold")
    yield Text("Probabilities in ppm, with contact, by subset simulation; 95 % intervals.")
    yield FigureTable(TAIL_COLUMNS, tail_rows(found))


def tail_rows(found: xr.Dataset) -> list[list[str]]:
    """Events, with their probabilities."""
    return [[str(event), _ppm(found.sel(event=event))] for event in found["event"].values]


def _ppm(of: xr.Dataset) -> str:
    ppm = [1e6 * float(value) for value in of["probability"].values]
    estimate, lower, upper = (grouped(round(value)) if value >= 1000 else f"{value:.3g}" for value in ppm)
    return f"{estimate} [{lower}, {upper}]"
