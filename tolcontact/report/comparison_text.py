"""Comparisons of runs, and of solvers, as text."""

import math
from collections.abc import Iterator, Mapping

import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact import vocabulary as terms
from tolcontact.report.contributor_shares import ContributorShares
from tolcontact.report.figures import grouped, number, percent, settled
from tolcontact.report.table import Table

VALUES = ("", "mean", "6 sigma", terms.PPK, terms.OUT_OF_SPECIFICATION_COLUMN)
MAX_CONTRIBUTORS = 5  # of a run
CHANGES = ("", "shift of mean", "6 sigma", f"{terms.OUT_OF_SPECIFICATION_COLUMN},\npoints", "largest\ndifference")
_DRAWS = {
    terms.SAME_DRAWS: "the same draws; changes are from the same realizations",
    terms.SAME_SEED: "the same seed, but other draws; changes are realization by realization",
    terms.OTHER_DRAWS: "other draws; the runs are compared as independent samples",
}


def runs_text(comparison: xr.Dataset) -> Group:
    """Return a comparison (see compare_runs) for rich to print."""
    return Group(*_sections(comparison))


def _sections(comparison: xr.Dataset) -> Iterator[Text | Table]:
    yield Text(comparison.attrs["title"], style="bold")
    for line in runs_lines(comparison):
        yield Text(line)
    for name in comparison["measure"].values:
        measure = comparison.sel(measure=name)
        yield Text(f"\n{name} ({measure['measure_units'].values})", style="bold")
        yield value_table(measure)
        yield Text(f"\nchanges from {comparison.attrs['reference_run']}")
        yield change_table(measure)


def runs_lines(comparison: xr.Dataset) -> Iterator[str]:
    """Yield a description of each run, and of parts that only some runs have."""
    for name in comparison["run"].values:
        run = comparison.sel(run=name)
        statuses = zip(run["status_meaning"].values, run["by_status"].values, strict=True)
        counts = [f"{int(n)} {meaning}" for meaning, n in statuses if n]
        lines = [
            f"{name}: {run['title'].values}",
            f"{grouped(int(run['realizations']))} realizations: {', '.join(counts)}",
            "largest penetration: "
            + ", ".join(f"{_depth(run, state)} mm {terms.WORD_OF_STATE[state]}" for state in terms.STATES),
        ]
        if name != comparison.attrs["reference_run"]:
            lines.append(_DRAWS[str(run["draws"].values)])
        yield "\n  ".join(lines)
    if left_out := comparison.attrs["left_out"]:
        yield f"not in all runs, and left out: {left_out}"


def value_table(measure: xr.Dataset) -> Table:
    """Return the figures of a measure by run and state: mean, 6 sigma, Ppk and share out of specification."""
    rows = []
    for run in measure["run"].values:
        rows.append([str(run), *[""] * (len(VALUES) - 1)])
        for state in terms.STATES:
            mean, spread, ppk, outside = measure["value"].sel(run=run, state=state).values
            rows.append([f"  {terms.WORD_OF_STATE[state]}", number(mean), number(spread), number(ppk), percent(outside)])
    return Table("", VALUES, rows)


def change_table(measure: xr.Dataset) -> Table:
    """Return the changes of a measure by run and state: changes of mean, 6 sigma and share, and the largest difference."""
    rows = []
    for run in measure["run"].values[1:]:
        rows.append([str(run), *[""] * (len(CHANGES) - 1)])
        for state in terms.STATES:
            changes = measure.sel(run=run, state=state)
            mean, ratio, outside = changes["change"].values
            furthest = float(changes["furthest"])
            cells = [number(mean, sign=True), percent(ratio - 1, sign=True), percent(outside, sign=True)]
            rows.append([f"  {terms.WORD_OF_STATE[state]}", *cells, f"{furthest:.2g}" if math.isfinite(furthest) else "-"])
    return Table("", CHANGES, rows)


def contributor_table(shares: Mapping[str, ContributorShares]) -> Table:
    """Return the largest contributors of a measure in each run, by their share of its variance; no rows without shares."""
    by_run = {run: dict(zip(of_run.groups, of_run.shares, strict=True)) for run, of_run in shares.items()}
    largest = dict.fromkeys(group for of_run in by_run.values() for group in list(of_run)[:MAX_CONTRIBUTORS])
    missing = [math.nan] * len(terms.ESTIMATE)
    rows = [[group, *(percent(of_run.get(group, missing)) for of_run in by_run.values())] for group in largest]
    return Table("Contributors, share of the variance with contact", ["", *by_run], rows)


def _depth(run: xr.Dataset, state: str) -> str:
    return f"{settled(float(run['penetration'].sel(state=state))):.3g}"


def comparison_text(comparison: xr.Dataset) -> Group:
    """Return a comparison (see compare) for rich to print in 80 columns."""
    count = comparison.attrs["realizations"]
    rows = []
    for solver in comparison["solver"].values:
        row = comparison.sel(solver=solver)
        differences = [row["pose_difference"].sel(extent=extent) for extent in ("median", "largest")]
        differences.append(row["measure_difference"].sel(extent="largest").max())
        unresolved = int(row["by_status"][list(terms.UNRESOLVED)].sum())
        residual = f"{float(row['kkt_residual']):.1g}"
        figures = [f"{float(difference):.1g}" for difference in differences]
        rows.append([str(solver), f"{1e6 * float(row['seconds']) / count:.1f}", str(unresolved), residual, *figures])
    columns = ["solver", "us each", "not\nresolved", "residual", "pose,\nmedian", "pose,\nlargest", "measure,\nlargest"]
    heading = f"{comparison.attrs['title']}: {count} realizations, {comparison.attrs['resolution']}"
    reference = comparison.attrs["reference_solver"]
    note = f"In mm (measurements in their own units): residuals, differences from {reference}."
    return Group(Text(heading, style="bold"), Text(note), Text(), Table("", columns, rows))
