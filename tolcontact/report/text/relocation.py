"""The best place of a locator, for the terminal."""

from collections.abc import Iterator

import numpy as np
import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact.report.figures import grouped, number, share
from tolcontact.report.text.table import FigureTable
from tolcontact.vocabulary import PPM, STAGES


def relocation_text(found: xr.Dataset) -> Group:
    """A relocation (see tolcontact.analyses.relocate) as something that rich prints."""
    return Group(*_sections(found))


def _sections(found: xr.Dataset) -> Iterator[Text | FigureTable]:
    yield Text(f"{found.attrs['title']}: {grouped(found.sizes['trial'])} places tried", style="bold")
    yield Text(f"{grouped(found.attrs['samples'])} realizations each, {grouped(found.attrs['fresh'])} other ones below;")
    yield Text("95 % intervals.\n")
    yield FigureTable(*relocation_table(found))
    if lost := int(found["unresolved"].max()):
        yield Text(f"{grouped(lost)} realizations were not resolved; their last poses are included")


def relocation_table(found: xr.Dataset) -> tuple[list[str], list[list[str]]]:
    """Places and what is to be least there, before and after: columns and rows."""
    is_share = found.attrs["least"].endswith(PPM)
    rows = []
    for k, stage in enumerate(STAGES):
        place = ", ".join(f"{c:.4g}" for c in found["point"].values[k])
        reached = found["reached"].values[k]
        rows.append([f"{stage}: ({place})", share(reached) if is_share else number(reached)])
    change = found["change"].values
    said = (
        f"{1e6 * change[0]:+.0f} ppm [{1e6 * change[1]:.0f}, {1e6 * change[2]:.0f}]" if is_share else number(np.asarray(change))
    )
    rows.append(["after less before" if is_share else "after over before", said])
    units = "" if is_share else f" [{found['measure_units'].values}]"
    return [found.attrs["locator"], f"{found.attrs['least']}{units}"], rows
