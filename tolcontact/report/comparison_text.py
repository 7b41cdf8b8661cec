"""Comparisons of runs, of their models, and of solvers, as text."""

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact import vocabulary as terms
from tolcontact.report.contributor_shares import ContributorShares
from tolcontact.report.table import Table, by_measure, grouped, number, percent, settled
from tolcontact.texts import clipped

VALUES = ("", "mean", "6 sigma", terms.PPK, terms.OUT_OF_SPECIFICATION_COLUMN)
MAX_CONTRIBUTORS = 5  # of a run
CHANGES = ("", "shift of mean", "6 sigma", f"{terms.OUT_OF_SPECIFICATION_COLUMN},\npoints", "largest\ndifference")
IGNORED = "declared_at", "title_block"  # of a model: lines of a script; the title block is stated elsewhere
MAX_VALUE = 60  # characters of a value of a model
_DRAWS = {
    terms.SAME_DRAWS: "the same draws; changes are from the same realizations",
    terms.SAME_SEED: "the same seed, but other draws; changes are realization by realization",
    terms.OTHER_DRAWS: "other draws; the runs are compared as independent samples",
}
_FEW_PARTS = {
    terms.OPEN_INCLUDED: "known from few parts, which intervals include; different parts of two runs count as independent",
    terms.OPEN_LEFT_OUT: 'known from few parts, which no interval includes without deviations (keep="all")',
}


def runs_text(comparison: xr.Dataset) -> Group:
    """Return a comparison (see compare_runs) for rich to print."""
    sections: list[Text | Table] = [Text(comparison.attrs["title"], style="bold"), *map(Text, runs_lines(comparison))]
    for measure in by_measure(comparison):
        sections.append(Text(f"\n{measure['measure'].values} ({measure['measure_units'].values})", style="bold"))
        sections += [value_table(measure), Text(f"\nchanges from {comparison.attrs['reference_run']}"), change_table(measure)]
    return Group(*sections)


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
        if text := _FEW_PARTS.get(str(run[terms.FEW_PARTS].values)):
            lines.append(text)
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


def model_changes(before: Any, after: Any, place: str = "") -> Iterator[str]:
    """Yield a sentence for each value that differs in two documents of models, such as "cover, H1, width: 0.2, now 0.1"."""
    if isinstance(before, dict) and isinstance(after, dict):
        old, new = ({key: value for key, value in model.items() if key not in IGNORED} for model in (before, after))
        yield from _changes(old, new, place)
    elif isinstance(before, list) and isinstance(after, list) and any(isinstance(entry, dict) for entry in before + after):
        yield from _changes(_by_name(before), _by_name(after), place)
    elif before != after:
        yield f"{place}: {_shown(before)}, now {_shown(after)}"


def _changes(before: dict[str, Any], after: dict[str, Any], place: str) -> Iterator[str]:
    for key in dict.fromkeys((*before, *after)):
        where = f"{place}, {key}" if place else key
        if key not in after:
            yield f"{where}: removed ({_shown(before[key])})"
        elif key not in before:
            yield f"{where}: added ({_shown(after[key])})"
        else:
            yield from model_changes(before[key], after[key], where)


def _by_name(entries: list[Any]) -> dict[str, Any]:
    """Return entries by their names, or by their kinds or numbers if they have none."""
    named: dict[str, Any] = {}
    for position, entry in enumerate(entries, start=1):
        labels = [entry.get(key) for key in ("name", "kind", "part")] if isinstance(entry, dict) else []
        name = next((label for label in labels if isinstance(label, str) and label), "")
        named[name if name and name not in named else f"{name} {position}".strip()] = entry
    return named


def _shown(value: Any) -> str:
    """Return a value in a line: the name of a thing, a number without the noise of computing it, or a clipped text."""
    if isinstance(value, dict) and "name" in value:
        return str(value["name"])
    if isinstance(value, float):
        return f"{value:.12g}"
    return clipped(value if isinstance(value, str) else json.dumps(value, ensure_ascii=False), MAX_VALUE)
