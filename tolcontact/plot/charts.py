"""Charts, with matplotlib."""

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.errors import OptionError
from tolcontact.realizations import finished
from tolcontact.statistics import limits

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
    states: Sequence[str] = terms.STATES,
    bins: int = BINS,
    axes: Axes | None = None,
) -> Axes:
    """The distribution of a measure (the only one, if there is one), with its limits, and normal curves of mean and variance.

    Heights are shares of all realizations in a bin, in %; both states have the same bins. Raises OptionError for a measure or a
    state that is not there, or a measure without numbers.
    """
    rows = results.to_dataset().isel({terms.REALIZATION: slice(finished(results))})
    place = _place(rows, measure)
    of = rows.isel({terms.MEASURE: place})
    if not states or not set(states) <= set(terms.STATES):
        raise OptionError(f"states are {list(states)}; expected some of: {', '.join(terms.STATES)}")
    values = {state: of[terms.MEASURED.name].sel({terms.STATE: state}).values for state in states}
    every = np.concatenate(list(values.values()))
    name, units = str(of[terms.MEASURE].values), str(of[terms.MEASURE_UNITS.name].values)
    if not np.isfinite(every).all():
        raise OptionError(f'measure "{name}" has values that are no numbers; nothing can be drawn of it')
    if axes is None:
        axes = plt.figure(layout="constrained").add_subplot()
    edges = np.histogram_bin_edges(every, bins)
    for state, x in values.items():
        weights = np.full(len(x), 100 / len(x))
        axes.hist(x, edges.tolist(), weights=weights, color=COLOURS[state], alpha=0.6, label=state)
        mean, sigma = float(x.mean()), float(x.std(ddof=1))
        if sigma > 0:
            z = np.linspace(-SIGMAS, SIGMAS, 161)
            height = 100 * (edges[1] - edges[0]) / (sigma * math.sqrt(2 * math.pi))
            axes.plot(mean + sigma * z, height * np.exp(-(z**2) / 2), ":", color=COLOURS[state], label=f"normal, {state}")
    for limit in limits(rows)[place]:
        if math.isfinite(limit):
            axes.axvline(limit, color=LIMIT, label="_limit")
    axes.set(xlabel=f"{name} [{units}]", ylabel="% of realizations", title=results.attrs.get("title", ""))
    axes.legend(frameon=False)
    return axes


def _place(rows: xr.Dataset, name: str | None) -> int:
    """Which of the measures is meant."""
    names = [str(each) for each in rows[terms.MEASURE].values]
    if name is None and len(names) == 1:
        return 0
    if name not in names:
        raise OptionError(f"measure is {name!r}; expected one of: {', '.join(names)}")
    return names.index(name)
