"""The comparison of runs as text."""

import math
from collections.abc import Iterator

import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact.report.figures import grouped, number, percent, share
from tolcontact.report.text.table import FigureTable
from tolcontact.vocabulary import OTHER_DRAWS, PPK, SAME_DRAWS, SAME_SEED, STATES

VALUES = ("", "mean", "6 sigma", PPK, "outside")
CHANGES = ("", "shift of mean", "6 sigma", "outside, points", "furthest")
_DRAWS = {
    SAME_DRAWS: "the same draws; changes are from the same realizations",
    SAME_SEED: "the same seed, but other draws; changes are realization by realization",
    OTHER_DRAWS: "other draws; changes are those of independent runs",
}


def runs_text(comparison: xr.Dataset) -> Group:
    """Return a comparison (see compare_runs) for rich to print."""
    return Group(*_sections(comparison))


def _sections(comparison: xr.Dataset) -> Iterator[Text | FigureTable]:
    yield Text(comparison.attrs["title"], style="bold")
    for line in runs_lines(comparison):
        yield Text(line)
    for name in comparison["measure"].values:
        measure = comparison.sel(measure=name)
        yield Text(f"\n{name} ({measure['measure_units'].values})", style="bold")
        yield FigureTable(VALUES, value_rows(measure))
        yield Text(f"\nchanges from {comparison.attrs['reference_run']}")
        yield FigureTable(CHANGES, change_rows(measure))


def runs_lines(comparison: xr.Dataset) -> Iterator[str]:
    """Yield a description of each run, and of parts that only some runs have."""
    for name in comparison["run"].values:
        run = comparison.sel(run=name)
        statuses = zip(run["status_meaning"].values, run["by_status"].values, strict=True)
        counts = [f"{int(n)} {meaning}" for meaning, n in statuses if n]
        lines = [
            f"{name}: {run['title'].values}",
            f"{grouped(int(run['realizations']))} realizations: {', '.join(counts)}",
            f"largest penetration: raw {_depth(run, 'raw')} mm, corrected {_depth(run, 'corrected')} mm",
        ]
        if name != comparison.attrs["reference_run"]:
            lines.append(_DRAWS[str(run["draws"].values)])
        yield "\n  ".join(lines)
    if left_out := comparison.attrs["left_out"]:
        yield f"not in all runs, and left out: {left_out}"


def value_rows(measure: xr.Dataset) -> list[list[str]]:
    """Return rows of a measure by run and state: mean, 6 sigma, Ppk and share outside."""
    rows = []
    for run in measure["run"].values:
        rows.append([str(run), *[""] * (len(VALUES) - 1)])
        for state in STATES:
            mean, spread, ppk, outside = measure["value"].sel(run=run, state=state).values
            rows.append([f"  {state}", number(mean), number(spread), number(ppk), share(outside)])
    return rows


def change_rows(measure: xr.Dataset) -> list[list[str]]:
    """Return rows of a measure by run and state: changes of mean, 6 sigma and share, and the largest difference."""
    rows = []
    for run in measure["run"].values[1:]:
        rows.append([str(run), *[""] * (len(CHANGES) - 1)])
        for state in STATES:
            changes = measure.sel(run=run, state=state)
            mean, ratio, outside = changes["change"].values
            furthest = float(changes["furthest"])
            cells = [number(mean, sign=True), percent(ratio - 1, sign=True), percent(outside, sign=True)]
            rows.append([f"  {state}", *cells, f"{furthest:.2g}" if math.isfinite(furthest) else "-"])
    return rows


def _depth(run: xr.Dataset, state: str) -> str:
    return f"{float(run['penetration'].sel(state=state)):.3g}"
