"""Which realizations of an archive are checked against the surfaces themselves, and what that found."""

from collections.abc import Iterator

import netCDF4
import numpy as np

from tolcontact import poses as pose
from tolcontact import vocabulary as terms
from tolcontact.vocabulary import ArchiveVariable


def choose(file: netCDF4.Dataset, count: int, seed: int) -> np.ndarray:
    """Numbers (row,) of certified realizations, `count` at most, in order.

    A third of them penetrate most at their contact points, a third have most points that carry, the rest are drawn.
    """
    rows = len(file.dimensions[terms.REALIZATION]) if count else 0
    deepest, busiest, drawn = (_Largest(count // 3), _Largest(count // 3), _Largest(count))
    lot = np.random.default_rng([seed, rows])
    for first, status, gap, carrying in _pieces(file, rows):
        number = first + np.flatnonzero(np.isin(status, terms.CERTIFIED))
        inside = -gap[number - first, 1].min(axis=1, initial=np.inf)
        # Only what exceeds rounding is deeper than anything else.
        deepest.add(number, np.where(inside > terms.ROUNDED, inside, 0.0))
        busiest.add(number, carrying[number - first].sum(axis=1))
        drawn.add(number, lot.random(len(number)))
    chosen = list(dict.fromkeys([*deepest.numbers, *busiest.numbers, *drawn.numbers]))
    return np.sort(chosen[:count]).astype(np.int64)


def _pieces(file: netCDF4.Dataset, rows: int) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
    for first in range(0, rows, terms.PIECE_ROWS):
        some = slice(first, min(first + terms.PIECE_ROWS, rows))
        status, gap, carrying = (
            np.ma.getdata(file[variable.name][some]) for variable in (terms.STATUS, terms.GAP_MIN, terms.CARRYING)
        )
        yield first, status, gap, carrying


class _Largest:
    """The numbers of the largest values above 0, the first of equals."""

    def __init__(self, count: int) -> None:
        self._count = count
        self.numbers, self._values = np.zeros(0, dtype=np.int64), np.zeros(0)

    def add(self, numbers: np.ndarray, values: np.ndarray) -> None:
        """Take in values of later numbers."""
        larger = values > (self._values[-1] if 0 < self._count == len(self._values) else 0.0)
        numbers = np.concatenate([self.numbers, numbers[larger]])
        values = np.concatenate([self._values, values[larger]])
        order = np.lexsort((numbers, -values))[: self._count]
        self.numbers, self._values = numbers[order], values[order]


def archived_poses(file: netCDF4.Dataset, rows: np.ndarray) -> np.ndarray | None:
    """Corrected poses (row, part, 12) of some rows; None if the archive does not keep poses."""
    if terms.ROTATION.name not in file.variables:
        return None
    R, t = (
        np.array([np.ma.getdata(file[variable.name][int(row), 1]) for row in rows])
        for variable in (terms.ROTATION, terms.TRANSLATION)
    )
    return pose.pose(R, t)


def nothing_checked(count: int, pairs: int) -> dict[ArchiveVariable, np.ndarray]:
    """What the group holds before anything was checked."""
    return {
        terms.CHECKED_REALIZATION: np.full(count, terms.UNFINISHED),
        terms.SURFACE_PENETRATION: np.full((count, pairs), np.nan),
        terms.BESIDE: np.full((count, pairs), np.nan),
    }
