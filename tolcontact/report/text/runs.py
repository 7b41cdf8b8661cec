"""A comparison of runs for the terminal."""

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
    """A comparison (see compare_runs) as something that rich prints."""
    return Group(*_sections(comparison))


def _sections(comparison: xr.Dataset) -> Iterator[Text | FigureTable]:
    yield Text(comparison.attrs["title"], style="bold")
    for line in runs_lines(comparison):
        yield Text(line)
    for measure in comparison["measure"].values:
        of = comparison.sel(measure=measure)
        yield Text(f"\n{measure} ({of['measure_units'].values})", style="bold")
        yield FigureTable(VALUES, value_rows(of))
        yield Text(f"\nchanges from {comparison.attrs['reference_run']}")
        yield FigureTable(CHANGES, change_rows(of))


def runs_lines(comparison: xr.Dataset) -> Iterator[str]:
    """What the runs are, one after the other."""
    for run in comparison["run"].values:
        of = comparison.sel(run=run)
        lost = [f"{int(n)} {name}" for name, n in zip(of["status_meaning"].values, of["by_status"].values, strict=True) if n]
        said = [
            f"{run}: {of['title'].values}",
            f"{grouped(int(of['realizations']))} realizations: {', '.join(lost)}",
            f"largest penetration: raw {_depth(of, 'raw')} mm, corrected {_depth(of, 'corrected')} mm",
        ]
        if run != comparison.attrs["reference_run"]:
            said.append(_DRAWS[str(of["draws"].values)])
        yield "\n  ".join(said)
    if left_out := comparison.attrs["left_out"]:
        yield f"not in all runs, and left out: {left_out}"


def value_rows(of: xr.Dataset) -> list[list[str]]:
    """Of one measure: run and state, mean, 6 sigma, Ppk and share outside."""
    rows = []
    for run in of["run"].values:
        rows.append([str(run), *[""] * (len(VALUES) - 1)])
        for state in STATES:
            mean, spread, ppk, outside = of["value"].sel(run=run, state=state).values
            rows.append([f"  {state}", number(mean), number(spread), number(ppk), share(outside)])
    return rows


def change_rows(of: xr.Dataset) -> list[list[str]]:
    """Of one measure: run and state, how mean, 6 sigma and share change, and the largest difference of a realization."""
    rows = []
    for run in of["run"].values[1:]:
        rows.append([str(run), *[""] * (len(CHANGES) - 1)])
        for state in STATES:
            one = of.sel(run=run, state=state)
            mean, ratio, outside = one["change"].values
            far = float(one["furthest"])
            cells = [number(mean, sign=True), percent(ratio - 1, sign=True), percent(outside, sign=True)]
            rows.append([f"  {state}", *cells, f"{far:.2g}" if math.isfinite(far) else "-"])
    return rows


def _depth(of: xr.Dataset, state: str) -> str:
    return f"{float(of['penetration'].sel(state=state)):.3g}"
