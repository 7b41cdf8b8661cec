"""A comparison of solvers for the terminal."""

import xarray as xr
from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from tolcontact.vocabulary import UNRESOLVED


def comparison_text(comparison: xr.Dataset) -> Group:
    """A comparison (see compare) as something that rich prints in 80 columns."""
    count = comparison.attrs["realizations"]
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), show_edge=False)
    table.add_column("solver", vertical="bottom")
    for column in ("us each", "not\nresolved", "residual", "pose,\nmedian", "pose,\nlargest", "measure,\nlargest"):
        table.add_column(column, justify="right", vertical="bottom", no_wrap=True)
    for solver in comparison["solver"].values:
        of = comparison.sel(solver=solver)
        lost = int(of["by_status"][list(UNRESOLVED)].sum())
        differences = [of["pose_difference"].sel(extent=extent) for extent in ("median", "largest")]
        table.add_row(
            str(solver),
            f"{1e6 * float(of['seconds']) / count:.1f}",
            str(lost),
            f"{float(of['kkt_residual']):.1g}",
            *(f"{float(difference):.1g}" for difference in differences),
            f"{float(of['measure_difference'].sel(extent='largest').max()):.1g}",
        )
    heading = f"{comparison.attrs['title']}: {count} realizations, {comparison.attrs['resolution']}"
    reference = comparison.attrs["reference_solver"]
    told = f"In mm (measures in their own units): residuals, differences from {reference}."
    return Group(Text(heading, style="bold"), Text(told), Text(), table)
