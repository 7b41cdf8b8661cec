"""Results of runs and of analyses as text: comparisons of runs and of solvers, analyses."""

import math
from collections.abc import Iterator, Sequence

import xarray as xr
from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from tolcontact.report.analysis_tables import analysis_report
from tolcontact.report.figures import grouped, number, percent, settled
from tolcontact.report.text.table import FigureTable
from tolcontact.vocabulary import (
    OTHER_DRAWS,
    OUT_OF_SPECIFICATION_COLUMN,
    PPK,
    SAME_DRAWS,
    SAME_SEED,
    STATES,
    UNRESOLVED,
    WORD_OF_STATE,
    AnalysisRecord,
)

VALUES = ("", "mean", "6 sigma", PPK, OUT_OF_SPECIFICATION_COLUMN)
CHANGES = ("", "shift of mean", "6 sigma", f"{OUT_OF_SPECIFICATION_COLUMN},\npoints", "largest\ndifference")
_DRAWS = {
    SAME_DRAWS: "the same draws; changes are from the same realizations",
    SAME_SEED: "the same seed, but other draws; changes are realization by realization",
    OTHER_DRAWS: "other draws; the runs are compared as independent samples",
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
            "largest penetration: " + ", ".join(f"{_depth(run, state)} mm {WORD_OF_STATE[state]}" for state in STATES),
        ]
        if name != comparison.attrs["reference_run"]:
            lines.append(_DRAWS[str(run["draws"].values)])
        yield "\n  ".join(lines)
    if left_out := comparison.attrs["left_out"]:
        yield f"not in all runs, and left out: {left_out}"


def value_rows(measure: xr.Dataset) -> list[list[str]]:
    """Return rows of a measure by run and state: mean, 6 sigma, Ppk and share out of specification."""
    rows = []
    for run in measure["run"].values:
        rows.append([str(run), *[""] * (len(VALUES) - 1)])
        for state in STATES:
            mean, spread, ppk, outside = measure["value"].sel(run=run, state=state).values
            rows.append([f"  {WORD_OF_STATE[state]}", number(mean), number(spread), number(ppk), percent(outside)])
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
            rows.append([f"  {WORD_OF_STATE[state]}", *cells, f"{furthest:.2g}" if math.isfinite(furthest) else "-"])
    return rows


def _depth(run: xr.Dataset, state: str) -> str:
    return f"{settled(float(run['penetration'].sel(state=state))):.3g}"


def comparison_text(comparison: xr.Dataset) -> Group:
    """Return a comparison (see compare) for rich to print in 80 columns."""
    count = comparison.attrs["realizations"]
    figures = ("us each", "not\nresolved", "residual", "pose,\nmedian", "pose,\nlargest", "measure,\nlargest")
    table = _table(["solver"], figures)
    for solver in comparison["solver"].values:
        row = comparison.sel(solver=solver)
        unresolved = int(row["by_status"][list(UNRESOLVED)].sum())
        differences = [row["pose_difference"].sel(extent=extent) for extent in ("median", "largest")]
        table.add_row(
            str(solver),
            f"{1e6 * float(row['seconds']) / count:.1f}",
            str(unresolved),
            f"{float(row['kkt_residual']):.1g}",
            *(f"{float(difference):.1g}" for difference in differences),
            f"{float(row['measure_difference'].sel(extent='largest').max()):.1g}",
        )
    heading = f"{comparison.attrs['title']}: {count} realizations, {comparison.attrs['resolution']}"
    reference = comparison.attrs["reference_solver"]
    note = f"In mm (measurements in their own units): residuals, differences from {reference}."
    return Group(Text(heading, style="bold"), Text(note), Text(), table)


def _table(labels: Sequence[str], figures: Sequence[str]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), show_edge=False)
    for label in labels:
        table.add_column(label, vertical="bottom")
    for figure in figures:
        table.add_column(figure, justify="right", vertical="bottom", no_wrap=True)
    return table


def analysis_text(record: AnalysisRecord, dataset: xr.Dataset) -> Group:
    """Return the dataset of an analysis as something that rich prints."""
    return Group(*_report_sections(record, dataset))


def _report_sections(record: AnalysisRecord, dataset: xr.Dataset) -> Iterator[Text | FigureTable]:
    report = analysis_report(record, dataset)
    yield Text(f"{dataset.attrs['title']}: {report.count}", style="bold")
    yield from map(Text, report.notes)
    for table in report.tables:
        if table.title:
            yield Text(f"\n{table.title}", style="bold")
        yield FigureTable(table.columns, table.rows)
        yield from map(Text, table.remarks)
