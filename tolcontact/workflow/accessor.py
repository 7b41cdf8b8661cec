"""Summaries of results, and their accessor `results.tolcontact`, of `tc.run`, `tc.open_archive` or xarray itself."""

from pathlib import Path

import numpy as np
import xarray as xr

from tolcontact import report, vocabulary as terms
from tolcontact.archive import check_rows, opened
from tolcontact.errors import OptionError
from tolcontact.realizations import finished
from tolcontact.statistics import Summary, summarize as summary_of, touching


def summarize(results: xr.DataTree | str | Path) -> Summary:
    """Return the statistics of results, or of the archive at a path (see tolcontact.statistics.summarize).

    `tc.summarize("run.nc").statistic_value.sel(measure="gap", state="corrected", statistic="6 sigma")`
    Raises ArchiveError if realizations differ from what was written, or if fewer than two are finished.
    """
    with opened(results) as tree:
        check_rows(tree)
        return summary_of(tree)


class Results:
    """The methods of results. A notebook shows them as figures and a report."""

    def __init__(self, results: xr.DataTree) -> None:
        self._results = results

    def summary(self) -> Summary:
        """Return the statistics with their intervals (see tc.summarize)."""
        return summarize(self._results)

    def field(self, part: str) -> xr.Dataset:
        """Return the displacement field of a part by the name of the part (see tolcontact.statistics)."""
        names = [str(name) for name in self._results.to_dataset()[terms.PART].values]
        if part not in names:
            raise OptionError(f'part is "{part}"; expected one of: {", ".join(names)}')
        group = self._results["field"].children[terms.group_of(part)].to_dataset(inherit=True)
        names = [str(name) for name in group.data_vars if name != terms.FIELD_SUMS.name]
        dimensions = {dim for name in names for dim in group[name].dims}
        field = group[names]
        return field.drop_vars([name for name in field.coords if name not in dimensions])

    def realization(self, number: int) -> xr.Dataset:
        """Return all values of one realization: measures, poses, gaps, status, deviations."""
        count = finished(self._results)
        if not 0 <= number < count:
            raise OptionError(f"realization is {number}; expected 0 to {count - 1}")
        rows = self._results.to_dataset()
        row = rows[[name for name, values in rows.data_vars.items() if terms.REALIZATION in values.dims]].isel(
            {terms.REALIZATION: number}
        )
        sample = self._results["sample"].to_dataset()
        if terms.DEVIATION.name in sample:
            row[terms.DEVIATION.name] = sample[terms.DEVIATION.name].isel({terms.REALIZATION: number})
        return row.assign_coords({terms.STATUS_MEANING: terms.STATUS_MEANINGS[int(row[terms.STATUS.name])]})

    def where_status(self, status: str | terms.Status) -> xr.DataTree:
        """Return the results of the realizations with a status, such as "not_assemblable"; they keep their numbers."""
        names = {meaning.name.lower(): meaning for meaning in terms.Status}
        if str(status) not in names and status not in list(terms.Status):
            raise OptionError(f"status is {status!r}; expected one of: {', '.join(names)}")
        rows = np.flatnonzero(self._results[terms.STATUS.name].values == int(names.get(str(status), status)))
        return self._results.isel({terms.REALIZATION: rows})

    def touching(self) -> xr.Dataset:
        """Return the positions of contact points and how often they touch (see tolcontact.statistics.touching)."""
        return touching(self._results)

    def __repr__(self) -> str:
        verbs = "summary(), field(part), realization(number), where_status(status), touching()"
        return f"{self._results.attrs.get('title', 'results')}: {verbs}"

    def _repr_html_(self) -> str:
        return report.results_html(self._results, self.summary())
