"""Analyses that an archive keeps beside its run."""

import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.checksums import crc32
from tolcontact.errors import ArchiveError

CHECKED = {variable.name: variable for variable in terms.ANALYZED}


def kept_analysis(results: xr.DataTree, name: str) -> xr.Dataset | None:
    """An analysis that an archive has; None if it has none. Raises ArchiveError if it is not what was written."""
    group = f"{terms.ANALYSES}/{name}"
    if terms.ANALYSES not in results.children or name not in results[terms.ANALYSES].children:
        return None
    found = results[group].to_dataset()
    for each, variable in found.data_vars.items():
        known = CHECKED.get(str(each))
        if known is None or crc32(known, variable.values) != int(variable.attrs.get(terms.CHECKSUM, -1)):
            raise ArchiveError(f"{group}/{each} in the archive is not what was written")
    return found
