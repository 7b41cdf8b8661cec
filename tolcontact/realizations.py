"""The realizations of a run, as results and archives have them: read piece by piece."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.errors import ArchiveError


def pieces(rows: xr.Dataset) -> Iterator[xr.Dataset]:
    """Yield the realizations in pieces that fit into memory."""
    for start in range(0, rows.sizes[terms.REALIZATION], terms.PIECE_ROWS):
        yield rows.isel({terms.REALIZATION: slice(start, start + terms.PIECE_ROWS)})


def statuses(rows: xr.Dataset) -> Iterator[np.ndarray]:
    """Yield their statuses, piece by piece. Raises ArchiveError for one that has no meaning."""
    for piece in pieces(rows[[terms.STATUS.name]]):
        status = piece[terms.STATUS.name].values
        if status.min(initial=0) < 0 or status.max(initial=0) >= len(terms.STATUS_MEANINGS):
            raise ArchiveError("the archive is damaged: some statuses are unknown; run the model again")
        yield status


def assembled(*runs: xr.Dataset) -> tuple[xr.Dataset, ...]:
    """Return the realizations of runs without those that one of them cannot assemble: their corrected state does not exist.

    The rest of a sampling plan counts as independent realizations, since its replicates are no longer complete.
    """
    exists = np.all([np.concatenate([*map(is_assembled, statuses(rows))]) for rows in runs], axis=0)
    if exists.all():
        return runs
    kept = {terms.REALIZATION: np.flatnonzero(exists)}
    return tuple(rows.isel(kept).assign_attrs(sampler=terms.MONTE_CARLO) for rows in runs)


def is_assembled(status: np.ndarray) -> np.ndarray:
    """Return which realizations can be assembled, by their statuses."""
    return np.asarray(status != terms.Status.NOT_ASSEMBLABLE)


def finished(results: xr.DataTree) -> int:
    """Return the number of realizations. Raises ArchiveError for a status that has no meaning."""
    return sum(map(len, statuses(results.to_dataset())))
