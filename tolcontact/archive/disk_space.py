"""Room for the rows of an archive on its disk."""

import shutil
from collections.abc import Sequence
from math import prod
from pathlib import Path

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive.rows import Row, kept_rows
from tolcontact.archive.variables import sizes_of_rows
from tolcontact.discretization import Nominal
from tolcontact.errors import ArchiveError

COPIES = 2  # of each row for a moment: in the journal, and in the archive


def check_room(path: Path, nominal: Nominal, rows: Sequence[Row], samples: int) -> None:
    """Raise ArchiveError if the disk has no room for `samples` more realizations of the variables `rows`."""
    needed, free = COPIES * samples * bytes_of_row(nominal, rows), shutil.disk_usage(path.parent).free
    if needed > free:
        keeps_poses = any(row.variable is terms.ROTATION for row in rows)
        advice = ", or keep less of each realization (measures)" if keeps_poses else ""
        raise ArchiveError(
            f'archive "{path}" needs {size_in_words(needed)} for {samples} realizations, but its disk has '
            f"{size_in_words(free)} free; ask for fewer, write to another disk{advice}"
        )


def bytes_of_rows(nominal: Nominal, keep: str, samples: int) -> int:
    """Return the size of `samples` realizations in an archive with the option `keep` [bytes]."""
    return samples * bytes_of_row(nominal, kept_rows(nominal, keep))


def bytes_of_row(nominal: Nominal, rows: Sequence[Row]) -> int:
    """Return the size of one realization [bytes]."""
    sizes = {terms.REALIZATION: 1, **sizes_of_rows(nominal)}
    stations = {terms.station_group(scene.station): {terms.STATION_PART: len(scene.assembly.parts)} for scene in nominal.scenes}
    return sum(
        np.dtype(row.variable.kind).itemsize * prod((sizes | stations.get(row.group, {}))[dim] for dim in row.variable.dims)
        for row in (Row("", terms.NUMBERS), *rows)
    )


def size_in_words(count: float) -> str:
    """Return a number of bytes with a readable unit: 1.5 GB."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"
