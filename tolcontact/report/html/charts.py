"""The data of a page's charts: histograms of measures, convergence of estimates, and pictures of dimension chains."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.declaration import Variable
from tolcontact.realizations import column
from tolcontact.report.contributor_shares import ContributorShares
from tolcontact.report.html.scene import Packed, packed
from tolcontact.report.table import plain
from tolcontact.statistics import intervals

BINS = 60
MAX_BARS = 10  # contributors next to a histogram
MAX_POINTS = 2000  # realizations in scatter charts
CONVERGENCE_STEPS = 40
MAX_LINKS = 60  # of a picture
LEFT, RIGHT, ROW = 190.0, 640.0, 24.0  # ends of the drawing, and the height of a row, in units of the picture
TICK = 3.0  # shortest length of an arrow; a shorter one is a tick
FIGURES = {"mean": "mean", "sixSigma": "6 sigma"}


def charts_of(results: xr.DataTree, summary: xr.Dataset) -> list[dict[str, Any]]:
    """Return name, units, limits, figures and distributions of each measure."""
    rows = results.to_dataset()[[terms.MEASURED.name]].isel({terms.REALIZATION: slice(summary.attrs["realizations"])})
    charts = []
    for number, name in enumerate(summary["measure"].values):
        measure, values = summary.sel(measure=name), _values(rows, number)
        estimates = measure["statistic_value"].sel(interval="estimate")
        edges = _edges(values)
        charts.append(
            {
                "name": str(name),
                "units": str(measure["measure_units"].values),
                "limits": [_finite(measure[f"measure_{side}"]) for side in terms.BOUNDS],
                "edges": edges.tolist(),
                "states": [{"settling": _convergence(x), "counts": _counts(x, edges).tolist()} for x in values],
                **{key: [_finite(value) for value in estimates.sel(statistic=figure)] for key, figure in FIGURES.items()},
            }
        )
    return charts


def bars_of(shares: ContributorShares) -> list[dict[str, Any]]:
    """Return the largest linear shares [%] of a measurement, with their intervals where there are any."""
    return [
        {"name": name, "share": (100 * np.where(np.isnan(values), values[0], values)).tolist()}
        for name, values in zip(shares.groups[:MAX_BARS], shares.shares, strict=False)
    ]


def compared_charts(runs: Mapping[str, xr.DataTree], comparison: xr.Dataset) -> list[dict[str, Any]]:
    """Return, for each measure of a comparison, the share [%] of realizations in common bins, by run and state."""
    charts = []
    rows = {
        name: run.to_dataset()[[terms.MEASURED.name]].isel({terms.REALIZATION: slice(int(count))})
        for (name, run), count in zip(runs.items(), comparison["realizations"].values, strict=True)
    }
    for name in comparison["measure"].values:
        values = {run: _values(table, table[terms.MEASURE].values.tolist().index(name)) for run, table in rows.items()}
        edges = _edges([x for states in values.values() for x in states])
        charts.append(
            {
                "name": str(name),
                "units": str(comparison["measure_units"].sel(measure=name).values),
                "limits": [_finite(comparison[f"measure_{side}"].sel(measure=name)[0]) for side in terms.BOUNDS],
                "edges": edges.tolist(),
                "runs": [
                    {"name": run, "shares": [(100 * _counts(x, edges) / len(x)).tolist() for x in states]}
                    for run, states in values.items()
                ],
            }
        )
    return charts


def relations_of(results: xr.DataTree, summary: xr.Dataset) -> dict[str, Any]:
    """Return measures (realization, state, measure) and deviations (realization, contributor) of the first realizations."""
    selection = {terms.REALIZATION: slice(min(summary.attrs["realizations"], MAX_POINTS))}
    sample = results["sample"].to_dataset()
    measured = packed(results.to_dataset()[terms.MEASURED.name].isel(selection).values)
    if terms.DEVIATION.name not in sample:
        return {"measured": measured, "contributors": []}
    deviations = sample[terms.DEVIATION.name].isel(selection).values
    is_varying = np.ptp(deviations, axis=0) > 0
    columns = (sample[name].values[is_varying] for name in (terms.CONTRIBUTOR, terms.CONTRIBUTOR_UNITS.name))
    contributors = [{"name": str(name), "units": str(unit)} for name, unit in zip(*columns, strict=True)]
    return {"measured": measured, "contributors": contributors, "deviations": packed(deviations[:, is_varying])}


def _values(rows: xr.Dataset, measure: int) -> list[np.ndarray]:
    """Return the values (realization,) of a measure in each state; an infinite value is not a number."""
    states = (column(rows, terms.MEASURED, state=state, measure=measure) for state in range(len(terms.STATES)))
    return [np.where(np.isfinite(x), x, np.nan) for x in states]


def _convergence(x: np.ndarray) -> Packed:
    """Return the mean of values (realization,) by number of realizations, with the half width of its 95 % interval."""
    n = np.unique(np.geomspace(2, len(x), CONVERGENCE_STEPS).round().astype(int))
    mean, mean_square = np.cumsum([x - x[0], (x - x[0]) ** 2], axis=1)[:, n - 1] / n
    s = np.sqrt(np.maximum(mean_square - mean**2, 0) * n / (n - 1))
    return packed(np.column_stack([n, x[0] + mean, [intervals.student(count - 1) for count in n] * s / np.sqrt(n)]))


def _edges(values: Sequence[np.ndarray]) -> np.ndarray:
    """Return the edges of common bins of several samples (realization,); none if a value is not finite."""
    low, high = min(float(x.min()) for x in values), max(float(x.max()) for x in values)
    if not (np.isfinite(low) and np.isfinite(high)):
        return np.array([])
    return np.linspace(low, high, BINS + 1) if high > low else np.array([low - 0.5, high + 0.5])


def _counts(x: np.ndarray, edges: np.ndarray) -> np.ndarray:
    return np.histogram(x, edges)[0] if edges.size else edges


def _finite(value: xr.DataArray) -> float | None:
    return float(value) if np.isfinite(value) else None


def loops_of(chains: Mapping[str, Mapping[str, Any]], variables: Iterable[Variable]) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of the picture of each chain of dimensions, by the name of its measure; the last row is the gap.

    chains   entries of chains in a document, by the names of their measures
    """
    dimensions = {variable.name: variable for variable in variables if variable.nominal is not None}
    return {
        name: _arrows(name, chain, dimensions)
        for name, chain in chains.items()
        if any(label in dimensions for label in chain["sensitivities"]) and len(chain["sensitivities"]) <= MAX_LINKS
    }


def _arrows(gap: str, chain: Mapping[str, Any], dimensions: Mapping[str, Variable]) -> list[dict[str, Any]]:
    """Return name, text, ends, height and kind of each arrow of a chain."""
    links = []
    for name, factor in chain["sensitivities"].items():
        if name in dimensions:
            times = "" if abs(factor) == 1 else f"{abs(factor):g} times "
            links.append((name, factor * float(dimensions[name].nominal or 0), f"{times}{dimensions[name].drawn}"))
    offset = float(chain.get("nominal", 0.0))
    links += [("constant", offset, plain(offset))] if offset else []
    places = list(accumulate((length for _, length, _ in links), initial=0.0))
    low, high = min(places), max(places)
    ends = [LEFT + (place - low) * (RIGHT - LEFT) / (high - low or 1.0) for place in places]
    arrows = [
        {"name": name, "text": text, "start": start, "end": end, "kind": "down" if length < 0 else "up"}
        for (name, length, text), start, end in zip(links, ends, ends[1:], strict=False)
    ]
    arrows.append({"name": gap, "text": plain(places[-1]), "start": ends[0], "end": ends[-1], "kind": "gap"})
    return [
        {**arrow, "y": ROW * (k + 0.5), "is_tick": abs(arrow["end"] - arrow["start"]) < TICK} for k, arrow in enumerate(arrows)
    ]
