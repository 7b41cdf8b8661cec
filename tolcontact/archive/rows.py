"""The variables of each realization in an archive: their groups, their values, and the disk space that they need."""

import math
import shutil
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.archive.variables import sizes_of_rows
from tolcontact.discretization import Nominal
from tolcontact.errors import ArchiveError
from tolcontact.simulation import Block
from tolcontact.vocabulary import ArchiveVariable

OMITTED = {
    "measures": {*terms.POSES, *terms.STATION_POSES, *terms.ELASTIC_ROWS, terms.DEVIATION},
    "poses": {terms.DEVIATION},
    "all": set(),
}
COPIES = 2  # of each row for a moment: in the journal, and in the archive


class Row(NamedTuple):
    """A variable of realizations in the group of that path; empty for the root."""

    group: str
    variable: ArchiveVariable

    @property
    def path(self) -> str:
        """The path of the variable in a file."""
        return f"{self.group}/{self.variable.name}"

    @property
    def label(self) -> str:
        """The name of the variable, with the group if several groups have it."""
        return self.path if self.variable in terms.STATION_ROWS else self.variable.name


def _row(variable: ArchiveVariable) -> Row:
    """Return a variable of realizations that belongs to no station in its group."""
    elastic = dict.fromkeys(terms.ELASTIC_ROWS, terms.ELASTIC_GROUP)
    return Row(({terms.DEVIATION: "sample"} | elastic).get(variable, ""), variable)


def kept_rows(nominal: Nominal, keep: str) -> tuple[Row, ...]:
    """Return the variables that an archive holds for each realization with the option `keep`."""
    rows = [_row(variable) for variable in terms.BY_REALIZATION]
    rows += [Row(terms.station_group(scene.station), variable) for scene in nominal.scenes for variable in terms.STATION_ROWS]
    rows += [_row(variable) for variable in terms.ELASTIC_ROWS if len(nominal.loads)]
    return tuple(row for row in rows if row.variable not in OMITTED[keep])


def row_values(block: Block, labels: Collection[str], nominal: Nominal) -> dict[str, np.ndarray]:
    """Return the values of variables of a block as they are stored, by their labels, in the order of an archive."""
    values = {_row(variable): array for variable, array in block.values().items()}
    for number, scene in enumerate(nominal.scenes):
        poses = block.poses[:, :, [k for k, part in enumerate(nominal.parts) if part.station == scene.station]]
        arrays = pose.translation(poses), pose.rotation(poses), block.station_status[:, number]
        group = terms.station_group(scene.station)
        values |= {Row(group, variable): array for variable, array in zip(terms.STATION_ROWS, arrays, strict=True)}
    if nominal.scenes:
        poses = block.poses[:, :, nominal.last_indices]
        values |= {Row("", terms.ROTATION): pose.rotation(poses), Row("", terms.TRANSLATION): pose.translation(poses)}
        values[Row("", terms.LOCATOR_OFFSET)] = block.locator_offset[:, nominal.last_indices]
    rows = [row for row in kept_rows(nominal, "all") if row.label in labels]
    return {row.label: np.ascontiguousarray(values[row], dtype=row.variable.kind) for row in rows}


def check_room(path: Path, nominal: Nominal, rows: Sequence[Row], samples: int) -> None:
    """Raise ArchiveError if the disk has no room for `samples` more realizations of the variables `rows`."""
    needed, free = COPIES * samples * _bytes_of_row(nominal, rows), shutil.disk_usage(path.parent).free
    if needed > free:
        keeps_poses = any(row.variable is terms.ROTATION for row in rows)
        advice = ", or keep less of each realization (measures)" if keeps_poses else ""
        raise ArchiveError(
            f'archive "{path}" needs {size_in_words(needed)} for {samples} realizations, but its disk has '
            f"{size_in_words(free)} free; ask for fewer, write to another disk{advice}"
        )


def bytes_of_rows(nominal: Nominal, keep: str, samples: int) -> int:
    """Return the size of `samples` realizations in an archive with the option `keep` [bytes]."""
    return samples * _bytes_of_row(nominal, kept_rows(nominal, keep))


def _bytes_of_row(nominal: Nominal, rows: Sequence[Row]) -> int:
    sizes = {terms.REALIZATION: 1, **sizes_of_rows(nominal)}
    stations = {terms.station_group(scene.station): {terms.STATION_PART: len(scene.assembly.parts)} for scene in nominal.scenes}
    return sum(
        np.dtype(row.variable.kind).itemsize
        * math.prod((sizes | stations.get(row.group, {}))[dim] for dim in row.variable.dims)
        for row in (Row("", terms.NUMBERS), *rows)
    )


def size_in_words(count: float) -> str:
    """Return a number of bytes with a readable unit: 1.5 GB."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"
