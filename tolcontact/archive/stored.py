"""A block of realizations as it will be stored: by whoever simulated it, so that the writer only writes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact import vocabulary as words
from tolcontact.checksums import crc32
from tolcontact.simulation import Block


class StoredBlock(NamedTuple):
    """Realizations `start` to `stop`: the values of each variable that is kept, by name, and their checksums."""

    start: int
    stop: int
    values: dict[str, np.ndarray]
    checksums: list[int]


def stored(block: Block, kept: Sequence[str]) -> StoredBlock:
    """A block, converted once for the file and for its checksums; `kept` are names of variables."""
    values = row_values(block, kept)
    checksums = [crc32(variable, values[variable.name]) for variable in words.BY_REALIZATION if variable.name in values]
    return StoredBlock(block.start, block.start + len(block), values, checksums)


def row_values(block: Block, kept: Sequence[str]) -> dict[str, np.ndarray]:
    """The values of variables, by their names, as they are stored."""
    found = {
        words.MEASURED: block.measured,
        words.GAP_MIN: block.gap_min,
        words.ACTIVE: block.active,
        words.CARRYING: block.carrying,
        words.REACTION: block.reaction,
        words.KKT_RESIDUAL: block.kkt_residual,
        words.ITERATIONS: block.iterations,
        words.STARTS: block.starts,
        words.SECOND_ANSWERS: block.second_answers,
        words.SEARCHED: block.searched,
        words.DEVIATION: block.deviations,
        words.STATUS: block.status,
    }
    if words.ROTATION.name in kept:
        found |= {words.ROTATION: pose.rotation(block.poses), words.TRANSLATION: pose.translation(block.poses)}
    return {
        variable.name: np.ascontiguousarray(found[variable], dtype=variable.kind)
        for variable in words.BY_REALIZATION
        if variable.name in kept
    }
