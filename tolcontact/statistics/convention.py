"""How much a result depends on the objective: offsets of parts from their locators, and changes under other objectives."""

from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.realizations import column, pieces
from tolcontact.statistics import intervals
from tolcontact.statistics.measure_statistics import changes_of
from tolcontact.statistics.sample import Sample
from tolcontact.vocabulary import ArchiveVariable

MIN_COMPARED = 10  # realizations: with fewer, 6 sigma has no interval
ACCURACY = 1e-6  # mm: a smaller offset is the accuracy of the solver


def offset_values(rows: xr.Dataset) -> dict[ArchiveVariable, Any]:
    """Return percentiles of the offset of each part from its locators, and the shares of large ones."""
    parts, total = rows.sizes[terms.PART], rows.sizes[terms.REALIZATION]
    values = {
        terms.OFFSET: np.full((parts, len(terms.OFFSET_PERCENTILES), len(terms.ESTIMATE)), np.nan),
        terms.OFFSET_BEYOND: np.full((parts, len(terms.ESTIMATE)), np.nan),
        terms.OFFSET_UNEXPLAINED: np.full((parts, len(terms.ESTIMATE)), np.nan),
    }
    if terms.LOCATOR_OFFSET.name not in rows:  # an archive of an earlier version
        return values
    variations, columns = rows[terms.LOCATOR_VARIATION.name].values, [v.name for v in (terms.LOCATOR_OFFSET, terms.GAP_MIN)]
    beyond, unexplained = np.zeros(parts, dtype=int), np.zeros(parts, dtype=int)
    for piece in pieces(rows[[*columns, terms.STATUS.name]]):
        offsets, gaps = (np.asarray(piece[name].values) for name in columns)
        depths = np.maximum(-np.fmin.reduce(gaps[:, terms.RAW], axis=1, initial=0), 0)
        is_certified = np.isin(piece[terms.STATUS.name].values, terms.CERTIFIED)
        beyond += (offsets > variations + ACCURACY).sum(axis=0)
        unexplained += ((offsets > variations + depths[:, None] + ACCURACY) & is_certified[:, None]).sum(axis=0)
    for part in np.flatnonzero(np.isfinite(variations)).tolist():
        x = Sample.of(column(rows, terms.LOCATOR_OFFSET, part=part))
        values[terms.OFFSET][part] = intervals.percentiles(x, list(terms.OFFSET_PERCENTILES.values()))
        values[terms.OFFSET_BEYOND][part] = intervals.proportion_of(int(beyond[part]), total)
        values[terms.OFFSET_UNEXPLAINED][part] = intervals.proportion_of(int(unexplained[part]), total)
    return values


def other_objectives(results: xr.DataTree) -> list[str]:
    """Return the objectives that a run was compared with; empty if it was not."""
    if terms.OBJECTIVES_GROUP not in results.children:
        return []
    return [str(name) for name in results[terms.OBJECTIVES_GROUP].to_dataset()[terms.BY_OBJECTIVE].values[1:]]


def changes_by_objective(results: xr.DataTree) -> dict[ArchiveVariable, Any]:
    """Return the changes of corrected measures if another objective decided, from realizations certified under both."""
    others, measures = other_objectives(results), results.to_dataset().sizes[terms.MEASURE]
    changes = np.full((len(others), measures, len(terms.CHANGES), len(terms.ESTIMATE)), np.nan)
    counts = np.zeros(len(others), dtype=np.int64)
    for k in range(len(others)):
        group = results[terms.OBJECTIVES_GROUP].to_dataset()
        measured, statuses = (group[v.name].values for v in (terms.MEASURED_BY_OBJECTIVE, terms.STATUS_BY_OBJECTIVE))
        both = np.isin(statuses[0], terms.CERTIFIED) & np.isin(statuses[k + 1], terms.CERTIFIED)
        counts[k] = both.sum()
        for measure in range(measures if counts[k] >= MIN_COMPARED else 0):
            baseline, x = (Sample.of(values[both, measure]) for values in (measured[0], measured[k + 1]))
            if np.isfinite(baseline.mean + x.mean):
                changes[k, measure] = changes_of(baseline, x)
    return {terms.BY_OTHER_OBJECTIVE: changes, terms.COMPARED_BY_OBJECTIVE: counts}
