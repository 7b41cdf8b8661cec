"""Statistics of results, or of the archive at a path."""

from pathlib import Path

import xarray as xr

from tolcontact.archive import check_rows, open_archive
from tolcontact.errors import OptionError
from tolcontact.statistics import Summary, summarize as summary_of


def summarize(results: xr.DataTree | str | Path) -> Summary:
    """Return the statistics of results, or of the archive at a path (see tolcontact.statistics.summarize).

    Raises ArchiveError if realizations differ from what was written, or if fewer than two are finished.
    """
    if isinstance(results, str | Path):
        with open_archive(results) as tree:
            return summarize(tree)
    if not isinstance(results, xr.DataTree):
        raise OptionError(
            f"results are a {type(results).__name__}; expected what tc.run or tc.open_archive returns, or an archive's path"
        )
    check_rows(results)
    return summary_of(results)
