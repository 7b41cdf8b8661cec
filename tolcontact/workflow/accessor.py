"""`results.tolcontact`: what a person asks of results, whether they come from `tc.run`, `tc.open_archive` or xarray itself."""

from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import plot
from tolcontact import vocabulary as terms
from tolcontact.errors import OptionError
from tolcontact.realizations import finished
from tolcontact.report.notebook import results_html
from tolcontact.statistics import Summary, touching
from tolcontact.workflow.run import summarize


class Plots:
    """`tc.plot` of these results (see tolcontact.plot)."""

    def __init__(self, results: xr.DataTree) -> None:
        self._results = results

    def histogram(self, measure: str | None = None, **options: Any) -> Any:
        """See tc.plot.histogram."""
        return plot.histogram(self._results, measure, **options)

    def field(self, statistic: str = "6 sigma", **options: Any) -> Any:
        """See tc.plot.field."""
        return plot.field(self._results, statistic, **options)

    def assembly(self, **options: Any) -> Any:
        """See tc.plot.assembly."""
        return plot.assembly(self._results, **options)


@xr.register_datatree_accessor("tolcontact")  # type: ignore[no-untyped-call]
class Results:
    """What is asked of results. In a notebook it shows itself: figures, and the report to turn."""

    def __init__(self, results: xr.DataTree) -> None:
        self._results = results

    @cached_property
    def plot(self) -> Plots:
        """Pictures."""
        return Plots(self._results)

    def summary(self) -> Summary:
        """Statistics with their intervals (see tc.summarize)."""
        return summarize(self._results)

    def field(self, part: str) -> xr.Dataset:
        """The displacement field of a part by its name, whatever its group is called (see tolcontact.statistics)."""
        names = [str(name) for name in self._results.to_dataset()[terms.PART].values]
        if part not in names:
            raise OptionError(f'part is "{part}"; expected one of: {", ".join(names)}')
        whole = self._results["field"].children[terms.group_of(part)].to_dataset(inherit=True)
        kept = [name for name, of in whole.data_vars.items() if terms.CHECKPOINT not in of.dims and name != terms.CHECKSUM]
        used = {dim for name in kept for dim in whole[name].dims}
        found = whole[kept]
        return found.drop_vars([name for name in found.coords if name not in used])

    def realization(self, number: int) -> xr.Dataset:
        """Everything that is kept of one realization: measures, poses, gaps, status, deviations."""
        done = finished(self._results)
        if not 0 <= number < done:
            raise OptionError(f"realization is {number}; expected 0 to {done - 1}")
        rows = self._results.to_dataset()
        row = rows[[name for name, of in rows.data_vars.items() if terms.REALIZATION in of.dims]].isel(
            {terms.REALIZATION: number}
        )
        sample = self._results["sample"].to_dataset()
        if terms.DEVIATION.name in sample:
            row[terms.DEVIATION.name] = sample[terms.DEVIATION.name].isel({terms.REALIZATION: number})
        return row.assign_coords({terms.STATUS_MEANING: terms.STATUS_MEANINGS[int(row[terms.STATUS.name])]})

    def where_status(self, status: str | terms.Status) -> xr.DataTree:
        """The results of the realizations with a status, such as "not_assemblable", with their numbers."""
        names = {each.name.lower(): each for each in terms.Status}
        if str(status) not in names and status not in list(terms.Status):
            raise OptionError(f"status is {status!r}; expected one of: {', '.join(names)}")
        rows = np.flatnonzero(self._results[terms.STATUS.name].values == int(names.get(str(status), status)))
        return self._results.isel({terms.REALIZATION: rows})

    def touching(self) -> xr.Dataset:
        """Where contact points touch, and how often (see tolcontact.statistics.touching)."""
        return touching(self._results)

    def __repr__(self) -> str:
        verbs = "summary(), field(part), realization(number), where_status(status), touching(), plot.histogram(measure)"
        return f"{self._results.attrs.get('title', 'results')}: {verbs}"

    def _repr_html_(self) -> str:
        return results_html(self._results, self.summary())
