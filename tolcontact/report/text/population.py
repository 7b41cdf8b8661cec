"""A population that was measured back, for the terminal."""

import numpy as np
import xarray as xr
from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from tolcontact import vocabulary as terms


def population_text(population: xr.Dataset) -> Group:
    """A population (see check_population) as something that rich prints in 80 columns."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), show_edge=False)
    table.add_column("feature", vertical="bottom")
    table.add_column("tolerance", vertical="bottom")
    for column in ("stated", "inside, %", "zone of\n99.73 %"):
        table.add_column(column, justify="right", vertical="bottom", no_wrap=True)
    for zone in range(population.sizes[terms.ZONE]):
        of = population.isel({terms.ZONE: zone})
        estimate, lower, upper = 100 * of[terms.SHARE_INSIDE.name].values
        stated = float(of[terms.STATED_SHARE.name])
        table.add_row(
            str(of[terms.ZONE_FEATURE.name].values),
            str(of[terms.ZONE_TOLERANCE.name].values),
            "" if np.isnan(stated) else f"{100 * stated:.5g}",
            f"{estimate:.2f} [{lower:.2f}, {upper:.2f}]",
            f"{float(of[terms.NEEDED_WIDTH.name]):.3g} mm",
        )
    heading = f"{population.attrs['title']}: {population.attrs['realizations']} of each feature, measured"
    return Group(Text(heading, style="bold"), Text(), table)
