"""Tables of the envelope of a mechanism over its positions."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.report.figures import grouped, number, percent
from tolcontact.report.table import Table

MAX_POSITIONS = 12  # rows of a table; of more, some evenly spaced ones are shown


def sweep_report(dataset: xr.Dataset, remarks: Sequence[str]) -> tuple[str, str, list[str], list[Table]]:
    """Return name, count, notes and tables of the envelope over all positions, and of the means at each."""
    positions, realizations = dataset.sizes["position"], dataset.attrs["realizations"]
    notes = [
        "The least and the largest value of each realization over all positions; 95 % intervals.",
        "What lies between two positions is not seen.",
        *remarks,
    ]
    rows = [row for name in dataset["measure"].values for row in _rows(dataset.sel(measure=name))]
    heading = ["", "mean", "6 sigma", "outer\npercentile", "mostly at"]
    envelope = Table("", heading, rows, ["outer percentile: 0.135 % of the least values, 99.865 % of the largest"])
    count = f"{grouped(realizations)} realizations at {positions} positions"
    return "Mechanism", count, notes, [envelope, _means(dataset)]


def _rows(measure: xr.Dataset) -> list[list[str]]:
    """Return the rows of a measure: its share outside, and both ends of its envelope in both states."""
    rows = [[f"{measure['measure'].values} ({measure['measure_units'].values})", "", "", "", ""]]
    has_limits = not np.isnan(measure["outside"].values).any()
    for word, state in zip(terms.STATE_WORDS, terms.STATES, strict=True):
        in_state = measure.sel(state=state)
        rows.append([f"  {word}", "", "", "", ""])
        for end, extreme in terms.WORD_OF_END.items():
            figures = [number(values) for values in in_state["envelope"].sel(end=end).values]
            rows.append([f"    {extreme}", *figures, _place(measure, in_state["extreme_share"].sel(end=end).values)])
        if has_limits:
            rows.append(["    beyond limits", percent(in_state["outside"].values), "", "", "at any position"])
    return rows


def _place(dataset: xr.Dataset, shares: np.ndarray) -> str:
    """Return the position at which most realizations have an extreme, with their share."""
    where = int(shares.argmax())
    return f"{_position(dataset, where)} ({100 * shares[where]:.0f} %)"


def _position(dataset: xr.Dataset, index: int) -> str:
    names, values = dataset["parameter_name"].values, dataset["parameter"].values
    moved = [k for k in range(len(names)) if np.ptp(values[k]) > 0] or [0]
    return ", ".join(f"{names[k]} {values[k, index]:.4g}" for k in moved)


def _means(dataset: xr.Dataset) -> Table:
    """Return the means with contact at some positions."""
    count = dataset.sizes["position"]
    chosen = np.unique(np.linspace(0, count - 1, min(count, MAX_POSITIONS)).round().astype(int))
    means = dataset["mean"].sel(state=terms.STATES[terms.CORRECTED])
    rows = [[_position(dataset, k), *(number(m.isel(position=k).values) for m in means)] for k in chosen]
    return Table(f"Mean {terms.WITH_CONTACT} at each position", ["", *map(str, dataset["measure"].values)], rows)
