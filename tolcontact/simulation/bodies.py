"""The watch over all bodies of a block: certificates of pairs that lie in each other are withdrawn, and other clashes counted."""

from collections.abc import Collection, Iterator
from typing import Protocol

import numpy as np

from tolcontact.compilation import Program
from tolcontact.vocabulary import CORRECTED


class Watched(Protocol):
    """A block of realizations, as far as bodies are concerned (see Block)."""

    poses: np.ndarray
    deviations: np.ndarray
    clashes: np.ndarray
    clash_depth: np.ndarray
    clash_part: np.ndarray
    clash_other: np.ndarray


def watch_bodies(program: Program, block: Watched, tested: Collection[tuple[int, int]]) -> Iterator[tuple[int, np.ndarray]]:
    """Count bodies without declared contact that lie in each other; yield the station and rows of those with contact.

    Pairs of bodies that were `tested` before are left out. A pair of parts counts once, also in several stations.
    """
    watch, nominal = program.watch, program.nominal
    poses, deviations = block.poses[:, CORRECTED], block.deviations
    stations = [scene.station for scene in nominal.scenes] or [""]
    counted = dict[frozenset[int], np.ndarray]()
    block.clashes[:] = 0
    for clash in watch.clashes(poses, deviations, left_out=tested):
        rows = clash.rows
        if clash.pair in watch.declared:
            yield stations.index(nominal.parts[clash.pair[0]].station), rows
        elif clash.pair not in watch.overlapping:
            numbers = sorted(nominal.number(index) for index in clash.pair)
            is_counted = counted.setdefault(frozenset(numbers), np.zeros(len(poses), dtype=bool))
            block.clashes[rows[~is_counted[rows]]] += 1
            is_counted[rows] = True
            depths = watch.measured(clash, poses, deviations).depths
            deepest = rows[depths > block.clash_depth[rows]]
            block.clash_depth[rows] = np.maximum(block.clash_depth[rows], depths)
            block.clash_part[deepest], block.clash_other[deepest] = numbers
