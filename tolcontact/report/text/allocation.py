"""Allocations for the terminal."""

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact.report.figures import grouped, number, share
from tolcontact.report.text.table import FigureTable
from tolcontact.vocabulary import EFFECTS, PPM, STAGES


def allocation_text(found: xr.Dataset) -> Group:
    """An allocation (see tolcontact.analyses.allocate) as something that rich prints."""
    return Group(*_sections(found))


def _sections(found: xr.Dataset) -> Iterator[Text | FigureTable]:
    yield Text(f"{found.attrs['title']}: {grouped(found.attrs['samples'])} realizations", style="bold")
    yield Text(f"What is required, in fresh runs of {grouped(found.attrs['fresh'])} realizations; 95 % intervals.\n")
    for place, (title, columns, rows) in enumerate(allocation_tables(found)):
        if place:
            yield Text(f"\n{title}", style="bold")
        yield FigureTable(columns, rows)


def allocation_tables(found: xr.Dataset) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """What is required, ranges, and effects on each measure: titles, columns, and rows."""
    rows = [
        [str(each), *(_kept(str(each), found["kept"].sel(requirement=each, stage=stage).values) for stage in STAGES)]
        for each in found["requirement"].values
    ]
    yield "Allocation", ["required", *STAGES], rows
    cost = found["cost"].sum("group").values
    yield f"Cost {cost[0]:.4g} before, {cost[1]:.4g} after", ["range", *STAGES, "factor"], list(_ranges(found))
    for measure in found["measure"].values:
        of = found["effect"].sel(measure=measure)
        title = f"{measure} [{of['measure_units'].values}]: changes if zones were a tenth narrower than before"
        yield title, ["", *EFFECTS], list(_effects(of))


def _kept(name: str, values: np.ndarray) -> str:
    return share(values) if f": {PPM}" in name else number(values)


def _ranges(found: xr.Dataset) -> Iterator[list[str]]:
    for group in found["group"].values:
        own = found.sel(group=group)
        widths = [f"{width:.4g}" if math.isfinite(width) else "several" for width in own["range"].values]
        yield [str(group), *widths, f"{float(own['factor']):.3g}"]


def _effects(of: xr.DataArray) -> Iterator[list[str]]:
    """Groups, that with the largest effect first."""
    first = of.sel(of_effect=EFFECTS[0], interval="estimate").values
    for k in np.argsort(first, kind="stable"):
        six_sigma, outside = of.isel(group=int(k)).values
        parts = tuple(1e6 * value for value in outside)
        yield [
            str(of["group"].values[k]),
            number(six_sigma, sign=True),
            f"{parts[0]:+.0f} ppm [{parts[1]:.0f}, {parts[2]:.0f}]",
        ]
