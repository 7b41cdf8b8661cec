"""Charts, with matplotlib."""

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from tolcontact.errors import OptionError
from tolcontact.realizations import finished
from tolcontact.vocabulary import BOUNDS, LOWER_LIMIT, MEASURE, MEASURE_UNITS, MEASURED, STATE, STATES, UPPER_LIMIT

try:
    import matplotlib.pyplot as plt
    from matplotlib.axes import Axes
except ModuleNotFoundError as error:
    raise OptionError("charts need matplotlib, which is not installed; install it: pip install '.[plot]'") from error

COLOURS = {"raw": "#7f8894", "corrected": "#d97706"}
BINS = 60
LIMIT = "#d01c1c"
SIGMAS = 4.0  # that a normal curve is drawn to, on either side


def histogram(
    results: xr.DataTree,
    measure: str | None = None,
    *,
    states: Sequence[str] = STATES,
    bins: int = BINS,
    axes: Axes | None = None,
) -> Axes:
    """The distribution of a measure (the only one, if there is one), with its limits, and normal curves of mean and variance.

    Heights are shares of all realizations in a bin, in %; both states have the same bins. Raises OptionError for a measure or a
    state that is not there, or a measure without numbers.
    """
    of = _measure(results, measure)
    unknown = [state for state in states if state not in STATES]
    if unknown or not states:
        raise OptionError(f"states are {list(states)}; expected some of: {', '.join(STATES)}")
    values = {state: of.sel({STATE: state}).values for state in states}
    every = np.concatenate(list(values.values()))
    if not np.isfinite(every).all():
        raise OptionError(f'measure "{of[MEASURE].values}" has values that are no numbers; nothing can be drawn of it')
    name, units = str(of[MEASURE].values), str(of[MEASURE_UNITS.name].values)
    axes = axes or plt.figure(layout="constrained").add_subplot()
    edges = np.histogram_bin_edges(every, bins)
    for state, x in values.items():
        weights = np.full(len(x), 100 / len(x))
        axes.hist(x, edges.tolist(), weights=weights, color=COLOURS[state], alpha=0.6, label=state)
        mean, sigma = float(x.mean()), float(x.std(ddof=1))
        if sigma > 0:
            z = np.linspace(-SIGMAS, SIGMAS, 161)
            height = 100 * (edges[1] - edges[0]) / (sigma * math.sqrt(2 * math.pi))
            axes.plot(mean + sigma * z, height * np.exp(-(z**2) / 2), ":", color=COLOURS[state], label=f"normal, {state}")
    for side in BOUNDS:
        limit = float(of[f"limit_{side}"].values)
        if math.isfinite(limit):
            axes.axvline(limit, color=LIMIT, label="_limit")
    axes.set(xlabel=f"{name} [{units}]", ylabel="% of realizations", title=results.attrs.get("title", ""))
    axes.legend(frameon=False)
    return axes


def _measure(results: xr.DataTree, name: str | None) -> xr.DataArray:
    """The values of a measure in finished realizations, with its units and limits."""
    rows = results.to_dataset().isel(realization=slice(finished(results)))
    names = [str(each) for each in rows[MEASURE].values]
    if name is None and len(names) == 1:
        name = names[0]
    if name not in names:
        raise OptionError(f"measure is {name!r}; expected one of: {', '.join(names)}")
    here = {MEASURE: names.index(name)}
    limits = {
        f"limit_{side}": float(rows[of.name].isel(here)) if of.name in rows else math.nan
        for side, of in zip(BOUNDS, (LOWER_LIMIT, UPPER_LIMIT), strict=True)
    }
    return rows[MEASURED.name].isel(here).assign_coords({MEASURE_UNITS.name: rows[MEASURE_UNITS.name].isel(here), **limits})
