"""Charts by matplotlib."""

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.errors import OptionError, check_choice
from tolcontact.realizations import finished
from tolcontact.statistics import limits

try:
    import matplotlib.pyplot as plt
    from matplotlib.axes import Axes
except ModuleNotFoundError as error:
    raise OptionError("charts need matplotlib, which is not installed; install it: pip install '.[plot]'") from error

COLOURS = {"raw": "#7f8894", "corrected": "#d97706"}
BINS = 60
LIMIT_COLOUR = "#d01c1c"
CURVE_SIGMAS = 4.0  # half the width of a normal curve, in standard deviations


def histogram(
    results: xr.DataTree,
    measure: str | None = None,
    *,
    states: Sequence[terms.StateName] = terms.STATES,
    bins: int = BINS,
    axes: Axes | None = None,
) -> Axes:
    """Draw the distribution of a measure with its limits, and normal curves of the same means and variances.

    `tc.plot.histogram(results, "gap", bins=40)` has 40 `bins`, 60 by default, of both `states`, in new `axes` or given ones.
    The name of the `measure` may be left out if there is only one. Heights are the shares of realizations in each bin, in %;
    both states have the same bins. Returns the matplotlib axes. Raises OptionError for an unknown measure or state, and for a
    measure with NaN values.
    """
    rows = results.to_dataset().isel({terms.REALIZATION: slice(finished(results))})
    names = [str(label) for label in rows[terms.MEASURE].values]
    if measure is not None or len(names) != 1:
        check_choice("measure", measure, names)
    place = names.index(str(measure)) if measure is not None else 0
    column = rows.isel({terms.MEASURE: place})
    if not states or not set(states) <= set(terms.STATES):
        raise OptionError(f"states are {list(states)}; expected some of: {', '.join(terms.STATES)}")
    values = {state: column[terms.MEASURED.name].sel({terms.STATE: state}).values for state in states}
    both_states = np.concatenate(list(values.values()))
    name, units = str(column[terms.MEASURE].values), str(column[terms.MEASURE_UNITS.name].values)
    if not np.isfinite(both_states).all():
        raise OptionError(f'measurement "{name}" has NaN values, so it cannot be drawn')
    if axes is None:
        axes = plt.figure(layout="constrained").add_subplot()
    edges = np.histogram_bin_edges(both_states, bins)
    for state, x in values.items():
        weights = np.full(len(x), 100 / len(x))
        axes.hist(x, edges.tolist(), weights=weights, color=COLOURS[state], alpha=0.6, label=terms.WORD_OF_STATE[state])
        mean, sigma = float(x.mean()), float(x.std(ddof=1))
        if sigma > 0:
            z = np.linspace(-CURVE_SIGMAS, CURVE_SIGMAS, 161)
            height = 100 * (edges[1] - edges[0]) / (sigma * math.sqrt(2 * math.pi))
            label = f"normal, {terms.WORD_OF_STATE[state]}"
            axes.plot(mean + sigma * z, height * np.exp(-(z**2) / 2), ":", color=COLOURS[state], label=label)
    for limit in limits(rows)[place][:2]:
        if math.isfinite(limit):
            axes.axvline(limit, color=LIMIT_COLOUR, label="_limit")
    axes.set(xlabel=f"{name} [{units}]", ylabel="% of realizations", title=results.attrs.get("title", ""))
    axes.legend(frameon=False)
    return axes
