"""Analyses of an archive on its page: contributions as bars, the others as tables."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.report.analysis_tables import analysis_report, archived_analysis

MAX_BARS = 15  # of a chart
CASES_NOTE = "Those with contact are the first of the single realizations above."


def contributions_of(results: xr.DataTree) -> list[dict[str, Any]]:
    """Return total and first-order shares of each measure's groups, in both states, the largest total share first."""
    dataset = archived_analysis(results, terms.CONTRIBUTIONS)
    return [] if dataset is None else [_shares(dataset.sel(measure=measure)) for measure in dataset["measure"].values]


def tables_of(results: xr.DataTree) -> Iterator[dict[str, Any]]:
    """Yield the tables of all other analyses, with titles, columns, rows, and remarks below."""
    for record in terms.ANALYSES.values():
        dataset = archived_analysis(results, record)
        if dataset is None:
            continue
        report = analysis_report(record, dataset)
        notes = [f"{report.count}. {' '.join(report.notes)}", *([CASES_NOTE] if record is terms.WORST_CASE else [])]
        for table in report.tables:
            if not table.is_detail:
                title = f"{report.name}: {table.title}" if table.title else report.name
                yield {"title": title, "columns": table.columns, "rows": table.rows, "remarks": [*table.remarks, *notes]}
                notes = []


def _shares(dataset: xr.Dataset) -> dict[str, Any]:
    total = dataset["total"].sel(interval="estimate")
    order = np.argsort(-np.nan_to_num(total.max("state").values), kind="stable")[:MAX_BARS]
    states = [
        {word: [_percents(dataset[word].values[state, k]) for k in order] for word in ("first", "total")}
        for state in range(len(terms.STATES))
    ]
    return {
        "measure": str(dataset["measure"].values),
        "groups": [str(dataset["group"].values[k]) for k in order],
        "states": states,
        "linear": _percents(dataset["linear"].values[order]),
    }


def _percents(shares: np.ndarray) -> list[float | None]:
    return [100 * float(share) if np.isfinite(share) else None for share in shares]
