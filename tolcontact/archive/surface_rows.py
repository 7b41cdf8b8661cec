"""Realizations of an archive that are checked against the surfaces themselves."""

from collections.abc import Iterator

import netCDF4
import numpy as np

from tolcontact import poses as pose
from tolcontact import vocabulary as terms
from tolcontact.vocabulary import ArchiveVariable


def choose(file: netCDF4.Dataset, count: int, seed: int) -> np.ndarray:
    """Return the numbers (row,) of at most `count` certified realizations, in order.

    A third are those that penetrate most at contact points, a third those with most carrying points; the others are random.
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
    numbers = list(dict.fromkeys([*deepest.numbers, *busiest.numbers, *random.numbers]))
    return np.sort(numbers[:count]).astype(np.int64)


def _pieces(file: netCDF4.Dataset, rows: int) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
    for start in range(0, rows, terms.PIECE_ROWS):
        rows_of_piece = slice(start, min(start + terms.PIECE_ROWS, rows))
        status, gap, carrying = (
            np.ma.getdata(file[variable.name][rows_of_piece]) for variable in (terms.STATUS, terms.GAP_MIN, terms.CARRYING)
        )
        yield start, status, gap, carrying


class _Largest:
    """The numbers of the largest values above 0, the first of equals."""

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


def archived_poses(file: netCDF4.Dataset, rows: np.ndarray) -> np.ndarray | None:
    """Return corrected poses (row, part, 12) of some rows; None if the archive does not keep poses."""
    if terms.ROTATION.name not in file.variables:
        return None
    R, t = (
        np.array([np.ma.getdata(file[variable.name][int(row), 1]) for row in rows])
        for variable in (terms.ROTATION, terms.TRANSLATION)
    )
    return pose.pose(R, t)


def empty_checks(count: int, pairs: int) -> dict[ArchiveVariable, np.ndarray]:
    """Return the values of the group before any check."""
    return {
        terms.CHECKED_REALIZATION: np.full(count, terms.UNFINISHED),
        terms.SURFACE_PENETRATION: np.full((count, pairs), np.nan),
        terms.BESIDE: np.full((count, pairs), np.nan),
    }
