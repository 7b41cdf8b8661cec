"""Worst cases for the terminal."""

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact.report.figures import grouped
from tolcontact.report.text.table import FigureTable
from tolcontact.vocabulary import CORRECTED, ENDS, STATES, STATUS_MEANINGS, UNRESOLVED, Status

WORST_COLUMNS = ("", "found", "bound", "random", "unseen ends")
UNSURE = 0.1  # from this share of unseen starts on, it is said that there may be worse ends


def worst_case_text(found: xr.Dataset) -> Group:
    """Worst cases (see tolcontact.analyses.worst_case) as something that rich prints."""
    return Group(*_sections(found))


def _sections(found: xr.Dataset) -> Iterator[Text | FigureTable]:
    simulated = int(found["by_status"].sum())
    yield Text(f"{found.attrs['title']}: {grouped(simulated)} combinations", style="bold")
    yield Text("Found by searches over all that the drawings allow; `bound`: no pose free of penetration")
    yield Text("lies beyond, to first order; `random`: the worst of random combinations.")
    for status in UNRESOLVED:
        if count := int(found["by_status"][status]):
            word = STATUS_MEANINGS[status].replace("_", " ")
            yield Text(f"{grouped(count)} combinations are {word}; they do not count")
    if found["by_status"][Status.NOT_ASSEMBLABLE]:
        yield Text("So the drawings allow parts that do not go together.", style="bold")
    for measure in found["measure"].values:
        of = found.sel(measure=measure)
        yield Text(f"\n{measure} [{of['measure_units'].values}]", style="bold")
        yield FigureTable(WORST_COLUMNS, list(worst_rows(of)))
        yield from map(Text, worst_remarks(of))
        yield FigureTable(["corrected", *ENDS], list(_combination(of.isel(state=CORRECTED))))


def worst_rows(of: xr.Dataset) -> Iterator[list[str]]:
    """Both ends of a measure in both states."""
    for state in STATES:
        for end in ENDS:
            own = of.sel(state=state, end=end)
            figures = [_figure(float(own[word])) for word in ("worst", "bound", "random")]
            yield [f"{state}, {end}", *figures, f"{100 * float(own['unseen']):.0f} %"]


def _figure(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "none"


def worst_remarks(of: xr.Dataset) -> Iterator[str]:
    """What has to be known of the worst cases of a measure."""
    sign = np.array([-1.0, 1.0])
    beyond = float((sign * (of["worst"] - of["bound"]).values).max())
    if beyond > 0:
        yield f"Up to {beyond:.2g} beyond the bound: so much is of second order in the deviations."
    if float(of["unseen"].max()) > UNSURE:
        yield "Searches ended at several values: there may be worse ones; more --samples look farther."


def _combination(of: xr.Dataset) -> Iterator[list[str]]:
    """Contributors that are not 0 in both combinations."""
    for label in of["contributor"].values:
        values = of["deviations"].sel(contributor=label).values
        if np.abs(values).max() > 0:
            yield [str(label), *(f"{value:+.4g}" for value in values)]
