"""What the charts of a page are drawn from: histograms of each measure in both states, and how estimates settle with N."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.realizations import pieces
from tolcontact.report.html.packed_array import packed
from tolcontact.statistics import intervals

BINS = 60
POINTS = 2000  # realizations that are shown as points
STEPS = 40  # numbers of realizations at which estimates are shown
FIGURES = {"mean": "mean", "sixSigma": "6 sigma"}


def charts_of(results: xr.DataTree, summary: xr.Dataset) -> list[dict[str, Any]]:
    """For each measure its name, units, limits, figures and distributions."""
    rows = results.to_dataset()[[terms.MEASURED.name]].isel({terms.REALIZATION: slice(summary.attrs["realizations"])})
    found = []
    for number, name in enumerate(summary["measure"].values):
        of = summary.sel(measure=name)
        states = [_of_state(rows, number, state) for state in range(len(terms.STATES))]
        edges = _edges(states)
        for state, own in enumerate(states):
            own["counts"] = _counts(rows, number, state, edges)
            del own["range"]
        found.append(
            {
                "name": str(name),
                "units": str(of["measure_units"].values),
                "limits": [_finite(of["measure_lower"]), _finite(of["measure_upper"])],
                "edges": edges.tolist(),
                "states": states,
                **{word: [_finite(each) for each in _estimates(of, name)] for word, name in FIGURES.items()},
            }
        )
    return found


def compared_charts(runs: Mapping[str, xr.DataTree], comparison: xr.Dataset) -> list[dict[str, Any]]:
    """For each measure of a comparison the share [%] of realizations in the same bins, by run and state."""
    found = []
    rows = {
        name: run.to_dataset()[[terms.MEASURED.name]].isel({terms.REALIZATION: slice(int(count))})
        for (name, run), count in zip(runs.items(), comparison["realizations"].values, strict=True)
    }
    for name in comparison["measure"].values:
        places = {run: own[terms.MEASURE].values.tolist().index(name) for run, own in rows.items()}
        both = range(len(terms.STATES))
        edges = _edges([{"range": _range(own, places[run], state)} for run, own in rows.items() for state in both])
        shares = [
            {
                "name": run,
                "shares": [[100 * k / own.sizes[terms.REALIZATION] for k in _counts(own, places[run], s, edges)] for s in both],
            }
            for run, own in rows.items()
        ]
        found.append(
            {
                "name": str(name),
                "units": str(comparison["measure_units"].sel(measure=name).values),
                "limits": [_finite(comparison[f"measure_{side}"].sel(measure=name)[0]) for side in terms.BOUNDS],
                "edges": edges.tolist(),
                "runs": shares,
            }
        )
    return found


def relations_of(results: xr.DataTree, summary: xr.Dataset) -> dict[str, Any]:
    """The first realizations one by one: measures (realization, state, measure), and deviations (realization, contributor)."""
    some = {terms.REALIZATION: slice(min(summary.attrs["realizations"], POINTS))}
    sample = results["sample"].to_dataset()
    found: dict[str, Any] = {
        "measured": packed(results.to_dataset()[terms.MEASURED.name].isel(some).values),
        "contributors": [],
    }
    if terms.DEVIATION.name in sample:
        varying = sample[terms.DEVIATION.name].dims[-1]  # archives before format 4 have locators alone
        deviations = sample[terms.DEVIATION.name].isel(some).values
        moves = np.ptp(deviations, axis=0) > 0
        units = (
            sample[terms.CONTRIBUTOR_UNITS.name].values if terms.CONTRIBUTOR_UNITS.name in sample else np.full(len(moves), "mm")
        )
        labels = zip(sample[varying].values[moves], units[moves], strict=True)
        found["contributors"] = [{"name": str(name), "units": str(unit)} for name, unit in labels]
        found["deviations"] = packed(deviations[:, moves])
    return found


def _estimates(of: xr.Dataset, statistic: str) -> xr.DataArray:
    return of["statistic_value"].sel(statistic=statistic, interval="estimate")


def _of_state(rows: xr.Dataset, measure: int, state: int) -> dict[str, Any]:
    """The range of a measure, and its mean after more and more realizations, with half of its 95 % interval (Student's t)."""
    total = rows.sizes[terms.REALIZATION]
    steps = np.unique(np.geomspace(2, total, STEPS).round().astype(int))
    low, high, count, middle = np.inf, -np.inf, 0, None
    sums, found = np.zeros(2), []
    for piece in pieces(rows):
        x = piece[terms.MEASURED.name].values[:, state, measure]
        low, high = min(low, float(x.min())), max(high, float(x.max()))
        middle = float(x[0]) if middle is None else middle
        cumulated = np.cumsum([x - middle, (x - middle) ** 2], axis=1)
        for n in steps[(steps > count) & (steps <= count + len(x))]:
            first, second = (sums + cumulated[:, n - count - 1]) / n
            s = float(np.sqrt(max(second - first**2, 0) * n / (n - 1)))
            found.append([int(n), middle + first, intervals.student(n - 1) * s / np.sqrt(n)])
        sums, count = sums + cumulated[:, -1], count + len(x)
    return {"range": (low, high), "settling": packed(np.array(found).reshape(-1, 3))}


def _range(rows: xr.Dataset, measure: int, state: int) -> tuple[float, float]:
    """The least and the largest value of a measure."""
    values = [piece[terms.MEASURED.name].values[:, state, measure] for piece in pieces(rows)]
    return min(float(x.min()) for x in values), max(float(x.max()) for x in values)


def _edges(states: list[dict[str, Any]]) -> np.ndarray:
    low, high = min(own["range"][0] for own in states), max(own["range"][1] for own in states)
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
