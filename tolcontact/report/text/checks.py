"""Comparisons of solvers and checks of populations as text."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from tolcontact import vocabulary as terms
from tolcontact.vocabulary import UNRESOLVED


def comparison_text(comparison: xr.Dataset) -> Group:
    """Return a comparison (see compare) for rich to print in 80 columns."""
    count = comparison.attrs["realizations"]
    figures = ("us each", "not\nresolved", "residual", "pose,\nmedian", "pose,\nlargest", "measure,\nlargest")
    table = _table(["solver"], figures)
    for solver in comparison["solver"].values:
        row = comparison.sel(solver=solver)
        unresolved = int(row["by_status"][list(UNRESOLVED)].sum())
        differences = [row["pose_difference"].sel(extent=extent) for extent in ("median", "largest")]
        table.add_row(
            str(solver),
            f"{1e6 * float(row['seconds']) / count:.1f}",
            str(unresolved),
            f"{float(row['kkt_residual']):.1g}",
            *(f"{float(difference):.1g}" for difference in differences),
            f"{float(row['measure_difference'].sel(extent='largest').max()):.1g}",
        )
    heading = f"{comparison.attrs['title']}: {count} realizations, {comparison.attrs['resolution']}"
    reference = comparison.attrs["reference_solver"]
    note = f"In mm (measures in their own units): residuals, differences from {reference}."
    return Group(Text(heading, style="bold"), Text(note), Text(), table)


def population_text(population: xr.Dataset) -> Group:
    """Return a population (see check_population) for rich to print in 80 columns."""
    table = _table(["feature", "tolerance"], ["stated", "inside, %", "zone of\n99.73 %"])
    for zone in range(population.sizes[terms.ZONE]):
        row = population.isel({terms.ZONE: zone})
        estimate, lower, upper = 100 * row[terms.SHARE_INSIDE.name].values
        stated = float(row[terms.STATED_SHARE.name])
        table.add_row(
            str(row[terms.ZONE_FEATURE.name].values),
            str(row[terms.ZONE_TOLERANCE.name].values),
            "" if np.isnan(stated) else f"{100 * stated:.5g}",
            f"{estimate:.2f} [{lower:.2f}, {upper:.2f}]",
            f"{float(row[terms.NEEDED_WIDTH.name]):.3g} mm",
        )
    heading = f"{population.attrs['title']}: {population.attrs['realizations']} of each feature, measured"
    return Group(Text(heading, style="bold"), Text(), table)


def _table(labels: Sequence[str], figures: Sequence[str]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), show_edge=False)
    for label in labels:
        table.add_column(label, vertical="bottom")
    for figure in figures:
        table.add_column(figure, justify="right", vertical="bottom", no_wrap=True)
    return table
