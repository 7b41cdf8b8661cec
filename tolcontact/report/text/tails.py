"""Rare events for the terminal."""

from collections.abc import Iterator

import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact.report.figures import grouped
from tolcontact.report.text.table import FigureTable


def tails_text(found: xr.Dataset) -> Group:
    """Rare events (see tolcontact.workflow.tails) as something that rich prints."""
    return Group(*_sections(found))


def _sections(found: xr.Dataset) -> Iterator[Text | FigureTable]:
    simulated = int(found["simulated"].sum())
    yield Text(f"{found.attrs['title']}: {grouped(simulated)} realizations", style="bold")
    yield Text("Probabilities in ppm, with contact, by subset simulation; 95 % intervals.")
    yield FigureTable(["", "ppm"], [[str(event), _ppm(found.sel(event=event))] for event in found["event"].values])


def _ppm(of: xr.Dataset) -> str:
    estimate, lower, upper = (f"{1e6 * float(value):.3g}" for value in of["probability"].values)
    return f"{estimate} [{lower}, {upper}]"
