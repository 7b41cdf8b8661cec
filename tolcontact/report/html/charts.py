"""The data of a page's charts: histograms of each measure in both states, and the convergence of estimates."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.realizations import pieces
from tolcontact.report.contributor_shares import ContributorShares
from tolcontact.report.html.scene import packed
from tolcontact.statistics import intervals

BINS = 60
MAX_BARS = 10  # contributors next to a histogram
MAX_POINTS = 2000  # realizations in scatter charts
CONVERGENCE_STEPS = 40
FIGURES = {"mean": "mean", "sixSigma": "6 sigma"}


def charts_of(results: xr.DataTree, summary: xr.Dataset) -> list[dict[str, Any]]:
    """Return name, units, limits, figures and distributions of each measure."""
    rows = results.to_dataset()[[terms.MEASURED.name]].isel({terms.REALIZATION: slice(summary.attrs["realizations"])})
    charts = []
    for number, name in enumerate(summary["measure"].values):
        measure = summary.sel(measure=name)
        states = [_convergence(rows, number, state) for state in range(len(terms.STATES))]
        edges = _edges([_range(rows, number, state) for state in range(len(terms.STATES))])
        for state, chart in enumerate(states):
            chart["counts"] = _counts(rows, number, state, edges)
        charts.append(
            {
                "name": str(name),
                "units": str(measure["measure_units"].values),
                "limits": [_finite(measure["measure_lower"]), _finite(measure["measure_upper"])],
                "edges": edges.tolist(),
                "states": states,
                **{key: [_finite(value) for value in _estimates(measure, figure)] for key, figure in FIGURES.items()},
            }
        )
    return charts


def bars_of(shares: ContributorShares) -> list[dict[str, Any]]:
    """Return the largest linear shares [%] of a measurement, with their intervals."""
    return [
        {"name": name, "share": [100 * float(value) for value in values]}
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
        positions = {run: table[terms.MEASURE].values.tolist().index(name) for run, table in rows.items()}
        states = range(len(terms.STATES))
        edges = _edges([_range(table, positions[run], state) for run, table in rows.items() for state in states])
        shares = [
            {
                "name": run,
                "shares": [
                    [100 * k / table.sizes[terms.REALIZATION] for k in _counts(table, positions[run], s, edges)] for s in states
                ],
            }
            for run, table in rows.items()
        ]
        charts.append(
            {
                "name": str(name),
                "units": str(comparison["measure_units"].sel(measure=name).values),
                "limits": [_finite(comparison[f"measure_{side}"].sel(measure=name)[0]) for side in terms.BOUNDS],
                "edges": edges.tolist(),
                "runs": shares,
            }
        )
    return charts


def relations_of(results: xr.DataTree, summary: xr.Dataset) -> dict[str, Any]:
    """Return measures (realization, state, measure) and deviations (realization, contributor) of the first realizations."""
    selection = {terms.REALIZATION: slice(min(summary.attrs["realizations"], MAX_POINTS))}
    sample = results["sample"].to_dataset()
    relations: dict[str, Any] = {
        "measured": packed(results.to_dataset()[terms.MEASURED.name].isel(selection).values),
        "contributors": [],
    }
    if terms.DEVIATION.name in sample:
        deviations = sample[terms.DEVIATION.name].isel(selection).values
        is_varying = np.ptp(deviations, axis=0) > 0
        units = sample[terms.CONTRIBUTOR_UNITS.name].values
        labels = zip(sample[terms.CONTRIBUTOR].values[is_varying], units[is_varying], strict=True)
        relations["contributors"] = [{"name": str(name), "units": str(unit)} for name, unit in labels]
        relations["deviations"] = packed(deviations[:, is_varying])
    return relations


def _estimates(measure: xr.Dataset, statistic: str) -> xr.DataArray:
    return measure["statistic_value"].sel(statistic=statistic, interval="estimate")


def _convergence(rows: xr.Dataset, measure: int, state: int) -> dict[str, Any]:
    """Return the mean of a measure by number of realizations, with the half width of its 95 % interval."""
    total = rows.sizes[terms.REALIZATION]
    steps = np.unique(np.geomspace(2, total, CONVERGENCE_STEPS).round().astype(int))
    count, centre, sums, estimates = 0, None, np.zeros(2), []
    for piece in pieces(rows):
        x = piece[terms.MEASURED.name].values[:, state, measure]
        centre = float(x[0]) if centre is None else centre
        cumulated = np.cumsum([x - centre, (x - centre) ** 2], axis=1)
        for n in steps[(steps > count) & (steps <= count + len(x))]:
            mean, mean_square = (sums + cumulated[:, n - count - 1]) / n
            s = float(np.sqrt(max(mean_square - mean**2, 0) * n / (n - 1)))
            estimates.append([int(n), centre + mean, intervals.student(n - 1) * s / np.sqrt(n)])
        sums, count = sums + cumulated[:, -1], count + len(x)
    return {"settling": packed(np.array(estimates).reshape(-1, 3))}


def _range(rows: xr.Dataset, measure: int, state: int) -> tuple[float, float]:
    """Return the smallest and the largest value of a measure."""
    values = [piece[terms.MEASURED.name].values[:, state, measure] for piece in pieces(rows)]
    return min(float(x.min()) for x in values), max(float(x.max()) for x in values)


def _edges(ranges: list[tuple[float, float]]) -> np.ndarray:
    low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
    if not (np.isfinite(low) and np.isfinite(high)):
        return np.array([])
    return np.linspace(low, high, BINS + 1) if high > low else np.array([low - 0.5, high + 0.5])


def _counts(rows: xr.Dataset, measure: int, state: int, edges: np.ndarray) -> list[int]:
    if not edges.size:
        return []
    counts = np.zeros(len(edges) - 1, dtype=int)
    for piece in pieces(rows):
        counts += np.histogram(piece[terms.MEASURED.name].values[:, state, measure], edges)[0]
    return counts.tolist()


def _finite(value: xr.DataArray) -> float | None:
    return float(value) if np.isfinite(value) else None
