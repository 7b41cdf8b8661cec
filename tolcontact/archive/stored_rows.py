"""Realizations in an archive: whether they are undamaged, which ones are checked against surfaces, and their poses."""

from collections.abc import Iterator, Sequence

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
    deepest, busiest, random = (_Largest(count // 3), _Largest(count // 3), _Largest(count))
    lot = np.random.default_rng([seed, rows])
    for start, status, gap, carrying in _pieces(file, rows):
        number = start + np.flatnonzero(np.isin(status, terms.CERTIFIED))
        inside = -gap[number - start, 1].min(axis=1, initial=np.inf)
        # Only what exceeds rounding is deeper than anything else.
        deepest.add(number, np.where(inside > terms.ROUNDED, inside, 0.0))
        busiest.add(number, carrying[number - start].sum(axis=1))
        random.add(number, lot.random(len(number)))
    fair = random.numbers[: count - 2 * (count // 3)]
    numbers = np.array(list(dict.fromkeys([*fair, *deepest.numbers, *busiest.numbers, *random.numbers])), dtype=np.int64)
    chosen = np.sort(numbers[:count])
    left_out = np.flatnonzero(~np.isin(random.numbers, chosen))
    return chosen, np.isin(chosen, random.numbers[: left_out[0] if len(left_out) else None])


def _pieces(file: netCDF4.Dataset, rows: int) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
    for start in range(0, rows, terms.PIECE_ROWS):
        rows_of_piece = slice(start, min(start + terms.PIECE_ROWS, rows))
        status, gap, carrying = (
            np.ma.getdata(file[variable.name][rows_of_piece]) for variable in (terms.STATUS, terms.GAP_MIN, terms.CARRYING)
        )
        yield start, status, gap, carrying


class _Largest:
    """The indices of the largest values above 0, the first of equals."""

    def __init__(self, count: int) -> None:
        self._count = count
        self.numbers, self._values = np.zeros(0, dtype=np.int64), np.zeros(0)

    def add(self, numbers: np.ndarray, values: np.ndarray) -> None:
        """Add the values of later numbers."""
        larger = values > (self._values[-1] if 0 < self._count == len(self._values) else 0.0)
        numbers = np.concatenate([self.numbers, numbers[larger]])
        values = np.concatenate([self._values, values[larger]])
        order = np.lexsort((numbers, -values))[: self._count]
        self.numbers, self._values = numbers[order], values[order]


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
