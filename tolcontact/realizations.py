"""The realizations of a run, as results and archives have them: read piece by piece; and its declared model and analyses."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.errors import ArchiveError

EXISTS = "exists"  # a coordinate of realizations, of which some are left out


def pieces(rows: xr.Dataset) -> Iterator[xr.Dataset]:
    """Yield the realizations in pieces that fit into memory, at least one, without those left out by `assembled`."""
    for start in range(0, max(rows.sizes[terms.REALIZATION], 1), terms.PIECE_ROWS):
        piece = rows.isel({terms.REALIZATION: slice(start, start + terms.PIECE_ROWS)})
        # A file gives a whole piece thousands of times as fast as most of its rows.
        yield piece.load().isel({terms.REALIZATION: piece[EXISTS].values}) if EXISTS in piece.coords else piece


def column(rows: xr.Dataset, variable: terms.ArchiveVariable, **places: int) -> np.ndarray:
    """Return the values (realization,) of a variable at some places along its other dimensions."""
    return np.concatenate([piece[variable.name].values for piece in pieces(rows[[variable.name]].isel(places))])


def statuses(rows: xr.Dataset) -> np.ndarray:
    """Return their statuses (realization,). Raises ArchiveError for one that has no meaning."""
    status = column(rows, terms.STATUS)
    if status.min(initial=0) < 0 or status.max(initial=0) >= len(terms.STATUS_MEANINGS):
        raise ArchiveError("the archive is damaged: some statuses are unknown; run the model again")
    return status


def assembled(*runs: xr.Dataset) -> tuple[xr.Dataset, ...]:
    """Return the runs, of which `pieces` leaves out what one of them cannot assemble: its corrected state does not exist.

    The rest of a sampling plan counts as independent realizations, since its replicates are no longer complete.
    """
    exists = np.all([is_assembled(statuses(rows)) for rows in runs], axis=0)
    if exists.all():
        return runs
    mask = {EXISTS: (terms.REALIZATION, exists)}
    return tuple(rows.assign_coords(mask).assign_attrs(sampler=terms.MONTE_CARLO) for rows in runs)


def is_assembled(status: np.ndarray) -> np.ndarray:
    """Return which realizations can be assembled, by their statuses."""
    return np.asarray(status != terms.Status.NOT_ASSEMBLABLE)


def finished(results: xr.DataTree) -> int:
    """Return the number of realizations. Raises ArchiveError for a status that has no meaning."""
    return len(statuses(results.to_dataset()))


def declaration_of(results: xr.DataTree) -> dict[str, Any]:
    """Return the declared model, as its document."""
    return dict(json.loads(str(results["model"][terms.DECLARATION.name].values)))


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
