"""Sensitivities for the terminal."""

from collections.abc import Iterator

import numpy as np
import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact.report.figures import grouped, number, percent
from tolcontact.report.text.table import FigureTable
from tolcontact.vocabulary import CORRECTED, UNRESOLVED

SENSITIVITY_COLUMNS = ("", "nominal", "untouched", "touched", "corrected", "spread", "kinks")
LEVERAGE_COLUMNS = ("", "leverage")
SMALL = 1e-3  # of the largest derivative of a measure: smaller ones are counted only


def sensitivities_text(found: xr.Dataset) -> Group:
    """Sensitivities (see tolcontact.analyses.sensitivities) as something that rich prints."""
    return Group(*_sections(found))


def _sections(found: xr.Dataset) -> Iterator[Text | FigureTable]:
    yield Text(f"{found.attrs['title']}: {grouped(found.attrs['realizations'])} realizations", style="bold")
    yield Text("Mean derivatives, 95 % intervals: without contact and with it, where they are smooth; and of")
    yield Text("all, with kinks and jumps, whose share is stated.")
    lost = int(found["by_status"].values[list(UNRESOLVED)].sum())
    if lost:
        yield Text(f"{grouped(lost)} realizations were not resolved; their last poses are included")
    for measure in found["measure"].values:
        of = found.sel(measure=measure)
        yield Text(f"\n{measure} ({of['measure_units'].values} for a unit of each)", style="bold")
        rows, small = sensitivity_rows(of)
        yield FigureTable(SENSITIVITY_COLUMNS, rows)
        if small:
            yield Text(f"and {small} that do next to nothing")
    if rows := leverage_rows(found):
        yield Text("\nLeverage of locators: the farthest that 1 mm moves a point of their part", style="bold")
        yield FigureTable(LEVERAGE_COLUMNS, rows)


def leverage_rows(found: xr.Dataset) -> list[list[str]]:
    """Locators, that with the largest leverage first."""
    leverage = found["leverage"].values
    order = [k for k in np.argsort(-leverage, kind="stable") if np.isfinite(leverage[k])]
    return [[str(found["contributor"].values[k]), f"{leverage[k]:.3g}"] for k in order]


def sensitivity_rows(of: xr.Dataset) -> tuple[list[list[str]], int]:
    """Contributors, those with the largest effect first; and how many are left out."""
    mean = np.abs(of["sensitivity"].sel(interval="estimate").values).max(axis=0)
    size = np.fmax(mean, of["spread"].max("state").values)
    rows = []
    for k in np.argsort(-size * of["step"].values, kind="stable"):
        if not size[k] > SMALL * np.nanmax(size):
            continue
        own = of.isel(contributor=int(k))
        split = [number(own["by_contact"].sel(contact=state).values) for state in ("untouched", "touched")]
        corrected = own["sensitivity"].isel(state=CORRECTED).values
        spread = f"{float(own['spread'][CORRECTED]):.2g}"
        name, nominal = str(own["contributor"].values), f"{float(own['nominal']):.3g}"
        rows.append([name, nominal, *split, number(corrected), spread, percent(own["changing"].values)])
    return rows, of.sizes["contributor"] - len(rows)
