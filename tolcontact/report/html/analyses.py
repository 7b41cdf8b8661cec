"""What a page shows of the analyses that its archive keeps: contributions as bars, the others as tables."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.report.figures import grouped
from tolcontact.report.text.allocation import allocation_tables
from tolcontact.report.text.relocation import relocation_table
from tolcontact.report.text.sensitivities import LEVERAGE_COLUMNS, SENSITIVITY_COLUMNS, leverage_rows, sensitivity_rows
from tolcontact.report.text.tails import TAIL_COLUMNS, tail_rows
from tolcontact.report.text.worst_case import WORST_COLUMNS, worst_remarks, worst_rows
from tolcontact.statistics import kept_analysis

MOST = 15  # bars of a chart


def contributions_of(results: xr.DataTree) -> list[dict[str, Any]]:
    """For each measure its groups, the largest total index first, with total and first-order shares of both states."""
    found = kept_analysis(results, terms.OF_CONTRIBUTIONS)
    return [] if found is None else [_shares(found.sel(measure=measure)) for measure in found["measure"].values]


def tables_of(results: xr.DataTree) -> Iterator[dict[str, Any]]:
    """Sensitivities, worst cases, rare events and allocation, with titles, columns and rows; some with remarks below."""
    slopes = kept_analysis(results, terms.OF_SENSITIVITIES)
    if slopes is not None:
        count = grouped(slopes.attrs["realizations"])
        for measure in slopes["measure"].values:
            rows, _ = sensitivity_rows(slopes.sel(measure=measure))
            yield {"title": f"Sensitivities of {measure}, {count} realizations", "columns": SENSITIVITY_COLUMNS, "rows": rows}
        if rows := leverage_rows(slopes):
            yield {"title": "Leverage of locators", "columns": LEVERAGE_COLUMNS, "rows": rows}
    worst = kept_analysis(results, terms.OF_WORST_CASE)
    if worst is not None:
        for measure in worst["measure"].values:
            of = worst.sel(measure=measure)
            title = f"Worst cases of {measure} [{of['measure_units'].values}], the first of the single realizations above"
            yield {"title": title, "columns": WORST_COLUMNS, "rows": list(worst_rows(of)), "remarks": list(worst_remarks(of))}
    rare = kept_analysis(results, terms.OF_TAILS)
    if rare is not None:
        yield {"title": "Rare events", "columns": TAIL_COLUMNS, "rows": tail_rows(rare)}
    allocation = kept_analysis(results, terms.OF_ALLOCATION)
    if allocation is not None:
        for title, columns, rows in allocation_tables(allocation):
            yield {"title": title, "columns": columns, "rows": rows}

    relocation = kept_analysis(results, terms.OF_RELOCATION)
    if relocation is not None:
        columns, rows = relocation_table(relocation)
        yield {"title": "Place of a locator", "columns": columns, "rows": rows}


def _shares(of: xr.Dataset) -> dict[str, Any]:
    total = of[terms.TOTAL].sel(interval="estimate")
    order = np.argsort(-np.nan_to_num(total.max("state").values), kind="stable")[:MOST]
    states = [
        {word: [_finite(of[word].values[state, k]) for k in order] for word in (terms.FIRST, terms.TOTAL)}
        for state in range(len(terms.STATES))
    ]
    return {
        "measure": str(of["measure"].values),
        "groups": [str(of["group"].values[k]) for k in order],
        "states": states,
        "linear": [_finite(of[terms.LINEAR].values[k, None])[0] for k in order],
    }


def _finite(values: np.ndarray) -> list[float | None]:
    return [100 * float(value) if np.isfinite(value) else None for value in values]
