"""Analyses that an archive holds."""

import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.errors import ArchiveError


def archived_analysis(results: xr.DataTree, record: terms.AnalysisRecord) -> xr.Dataset | None:
    """Return an analysis from an archive, or None. Raises ArchiveError if it differs from what was written."""
    if terms.ANALYSES_GROUP not in results.children or record.name not in results[terms.ANALYSES_GROUP].children:
        return None
    group = f"{terms.ANALYSES_GROUP}/{record.name}"
    dataset = results[group].to_dataset()
    try:
        dataset.load()
    except (OSError, RuntimeError) as error:
        raise ArchiveError(f"{group} in the archive is not what was written: {error}") from error
    if unknown := [str(name) for name in dataset.data_vars if str(name) not in record.known]:
        raise ArchiveError(f"{group}/{unknown[0]} in the archive is not what was written")
    return dataset
