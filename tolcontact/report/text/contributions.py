"""Contributions for the terminal."""

import math
from collections.abc import Iterator

import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact.report.figures import grouped, percent
from tolcontact.report.text.table import FigureTable
from tolcontact.vocabulary import CORRECTED, FIRST, SHAPLEY, STATES, TOTAL, UNRESOLVED

# What is drawn without contact is nearly a sum: its shares alone and in total hardly differ.
_COLUMNS = (("raw", TOTAL, "raw"), ("corrected, alone", FIRST, "corrected"), ("in total", TOTAL, "corrected"))
SMALL = 0.005  # total shares below that, in both states, are counted only


def contributions_text(found: xr.Dataset) -> Group:
    """Contributions (see tolcontact.analyses.contributions) as something that rich prints."""
    return Group(*_sections(found))


def _sections(found: xr.Dataset) -> Iterator[Text | FigureTable]:
    yield Text(f"{found.attrs['title']}: {grouped(found.attrs['realizations'])} realizations", style="bold")
    yield Text("Shares of variance: alone, and in total, together with others; 95 % intervals.")
    lost = int(found["by_status"].values[list(UNRESOLVED)].sum())
    if lost:
        yield Text(f"{grouped(lost)} realizations were not resolved; their last poses are included")
    for measure in found["measure"].values:
        of = found.sel(measure=measure)
        yield Text(f"\n{measure}", style="bold")
        rows, small = _rows(of)
        yield FigureTable(["", *(heading for heading, _, _ in _COLUMNS), "linear"], rows)
        if small:
            yield Text(f"and {small} of less than {100 * SMALL:g} % each")
        if of.sizes["unit"]:
            yield Text("Shapley effects, which divide what is correlated:")
            yield FigureTable(["", *STATES], _divided(of))
        off = [percent(of["missed"].sel(state=state).values) for state in STATES]
        yield Text(f"missed by linear sensitivities:\n  raw {off[0]}, corrected {off[1]}")


def _divided(of: xr.Dataset) -> list[list[str]]:
    """Shapley effects of those units that have one worth a line, the largest first."""
    sizes = of[SHAPLEY].sel(interval="estimate")
    order = sizes.isel(state=CORRECTED).argsort()[::-1].values
    return [
        [str(of["unit"].values[k]), *(percent(of[SHAPLEY].sel(state=state).values[k]) for state in STATES)]
        for k in order
        if not abs(float(sizes.isel(unit=k).max())) < SMALL
    ]


def _rows(of: xr.Dataset) -> tuple[list[list[str]], int]:
    """Groups, the largest total shares first; and how many are left out."""
    largest = of["total"].sel(interval="estimate").max("state", skipna=True)
    order = of["total"].sel(interval="estimate").isel(state=CORRECTED).argsort()[::-1].values
    rows = []
    for group in of["group"].values[order]:
        if float(largest.sel(group=group)) < SMALL:
            continue
        own = of.sel(group=group)
        shares = [percent(own[word].sel(state=state).values) for _, word, state in _COLUMNS]
        linear = float(own["linear"])
        rows.append([str(group), *shares, f"{100 * linear:.1f} %" if math.isfinite(linear) else "-"])
    return rows, of.sizes["group"] - len(rows)
