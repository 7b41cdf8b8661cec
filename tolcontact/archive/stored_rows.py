"""Realizations in an archive: whether they are undamaged, which ones are checked against surfaces, and their poses."""

from collections.abc import Sequence

import netCDF4
import numpy as np
import xarray as xr

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.errors import ArchiveError
from tolcontact.vocabulary import ArchiveVariable

PIECE_BYTES = 1 << 22  # of a variable that are read at once


def check_rows(results: xr.DataTree) -> None:
    """Raise ArchiveError if realizations are not what was written: the library compares the checksums of what it reads."""
    for group in results.subtree:
        for name, values in group.to_dataset(inherit=False).data_vars.items():
            if terms.REALIZATION in values.dims:
                _check_variable(str(name), values)


def _check_variable(name: str, values: xr.DataArray) -> None:
    row_bytes = values.dtype.itemsize * max(values.size // max(len(values), 1), 1)
    step = max(PIECE_BYTES // row_bytes // terms.BLOCK_ROWS, 1) * terms.BLOCK_ROWS
    for start in range(0, len(values), step):
        try:
            values[start : start + step].load()
        except (OSError, RuntimeError) as error:
            raise ArchiveError(
                f'the archive is damaged: "{name}" of realizations {start} to {min(start + step, len(values)) - 1} '
                f"is not what was written ({error}); run it again"
            ) from error


def choose(file: netCDF4.Dataset, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers (row,) of at most `count` certified realizations, in order, and whether each is a random choice.

    One third penetrate most at contact points, one third have the most points under load, and the rest are random: a fair
    sample of all certified realizations.
    """
    rows = len(file.dimensions[terms.REALIZATION]) if count else 0
    certified, depths, loads = _certified(file, rows)
    lots = np.random.default_rng([seed, rows]).random(len(certified))
    # Only what exceeds rounding is deeper than anything else.
    deepest, busiest, random = (
        certified[_largest(values, number)]
        for values, number in ((np.where(depths > terms.ROUNDED, depths, 0.0), count // 3), (loads, count // 3), (lots, count))
    )
    fair = random[: count - 2 * (count // 3)]
    numbers = np.array(list(dict.fromkeys([*fair, *deepest, *busiest, *random])), dtype=np.int64)
    chosen = np.sort(numbers[:count])
    left_out = np.flatnonzero(~np.isin(random, chosen))
    return chosen, np.isin(chosen, random[: left_out[0] if len(left_out) else None])


def _certified(file: netCDF4.Dataset, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the numbers (row,) of the certified realizations, their penetrations [mm], and their numbers of active points."""
    found = [(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0, dtype=np.int64))]
    for start in range(0, rows, terms.PIECE_ROWS):
        piece = slice(start, min(start + terms.PIECE_ROWS, rows))
        status, gaps, carrying = (
            np.ma.getdata(file[variable.name][piece]) for variable in (terms.STATUS, terms.GAP_MIN, terms.CARRYING)
        )
        places = np.flatnonzero(np.isin(status, terms.CERTIFIED))
        depths = -gaps[places, terms.CORRECTED].min(axis=1, initial=np.inf)
        found.append((start + places, depths, carrying[places].sum(axis=1)))
    numbers, depths, loads = map(np.concatenate, zip(*found, strict=True))
    return numbers, depths, loads


def _largest(values: np.ndarray, count: int) -> np.ndarray:
    """Return the places of the largest values (row,) above 0, the first of equals."""
    places = np.argsort(-values, kind="stable")[:count]
    return places[values[places] > 0]


def archived_poses(file: netCDF4.Dataset, rows: np.ndarray, stations: Sequence[str]) -> np.ndarray | None:
    """Return corrected poses (row, part, 12) of some rows; None if the archive does not keep poses.

    With `stations`, the parts of all stations follow one another.
    """
    if terms.ROTATION.name not in file.variables:
        return None
    groups = [(file[terms.station_group(station)], terms.STATION_POSES) for station in stations] or [(file, terms.POSES)]
    poses = []
    for group, variables in groups:
        t, R = (_rows_of(group[variable.name], rows) for variable in variables)
        poses.append(pose.pose(R, t))
    return np.concatenate(poses, axis=1)


def _rows_of(stored: netCDF4.Variable, rows: np.ndarray) -> np.ndarray:
    """Return the values in the corrected state of some rows: one read takes as long for a row as for a block."""
    values = np.empty((len(rows), *stored.shape[2:]))
    blocks = rows // terms.BLOCK_ROWS
    for block in np.unique(blocks):
        chosen = np.flatnonzero(blocks == block)
        first, last = rows[chosen].min(), rows[chosen].max()
        values[chosen] = np.ma.getdata(stored[first : last + 1, terms.CORRECTED])[rows[chosen] - first]
    return values


def empty_checks(count: int, pairs: int) -> dict[ArchiveVariable, np.ndarray]:
    """Return the values of the group before any check."""
    return {
        terms.CHECKED_REALIZATION: np.full(count, terms.UNCHECKED),
        terms.SURFACE_PENETRATION: np.full((count, pairs), np.nan),
        terms.BESIDE: np.full((count, pairs), np.nan),
        terms.FALSE_CONTACT: np.full((count, pairs), np.nan),
        terms.CONTACTS: np.full((count, pairs), np.nan),
        terms.CONTACTS_ENDED: np.full((count, pairs), np.nan),
        terms.AT_RANDOM: np.zeros(count, dtype=np.int8),
    }
