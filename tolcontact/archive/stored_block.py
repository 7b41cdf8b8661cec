"""A block of realizations as it will be stored; the worker that simulated it converts it, so that the writer only writes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.checksums import crc32
from tolcontact.simulation import Block


class StoredBlock(NamedTuple):
    """Realizations `start` to `stop`: the values of each variable that is kept, by name, and their checksums."""

    start: int
    stop: int
    values: dict[str, np.ndarray]
    checksums: list[int]


def stored(block: Block, kept: Sequence[str]) -> StoredBlock:
    """Return a block, converted once for the file and for its checksums; `kept` are names of variables."""
    values = row_values(block, kept)
    checksums = [crc32(variable, values[variable.name]) for variable in terms.BY_REALIZATION if variable.name in values]
    return StoredBlock(block.start, block.start + len(block), values, checksums)


def row_values(block: Block, kept: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the values of the variables named in `kept`, by name, as they are stored."""
    values = block.values()
    return {
        variable.name: np.ascontiguousarray(values[variable], dtype=variable.kind)
        for variable in terms.BY_REALIZATION
        if variable.name in kept
    }
