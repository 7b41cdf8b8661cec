"""The watch over all bodies of a block: it withdraws certificates of pairs that lie in each other, and counts other clashes."""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation import Program


class WatchedBodies(NamedTuple):
    """Bodies that lie in each other, in n realizations.

    withdrawn   stations, and the rows (k,) in which bodies with declared contact there lie in each other
    clashes     (n,) number of pairs of parts without declared contact that lie in each other
    depth       (n,) [mm]: how deep those of the deepest of these pairs do; 0 for none
    part, other (n,) their indices among the parts of the assembly; -1 for none
    """

    withdrawn: list[tuple[int, np.ndarray]]
    clashes: Int[Array, " n"]
    depth: Float[Array, " n"]
    part: Int[Array, " n"]
    other: Int[Array, " n"]


def watched_bodies(
    program: Program,
    poses: Float[Array, "n part 12"],
    deviations: Float[Array, "n contributor"],
    tested: Collection[tuple[int, int]] = (),
) -> WatchedBodies:
    """Return which bodies lie in each other at poses (n, part, 12); pairs that were `tested` before are left out.

    A pair of parts counts once, also if it lies in each other in several stations. Pairs that do nominally do not count.
    """
    watch, nominal, count = program.watch, program.nominal, len(poses)
    stations = [scene.station for scene in nominal.scenes] or [""]
    counted = dict[tuple[int, int], np.ndarray]()
    bodies = WatchedBodies([], np.zeros(count, dtype=int), np.zeros(count), np.full(count, -1), np.full(count, -1))
    for clash in watch.clashes(poses, deviations, left_out=tested):
        rows = clash.rows
        if clash.pair in watch.declared:
            bodies.withdrawn.append((stations.index(nominal.parts[clash.pair[0]].station), rows))
        elif clash.pair not in watch.overlapping:
            part, other = sorted(nominal.number(index) for index in clash.pair)
            is_counted = counted.setdefault((part, other), np.zeros(count, dtype=bool))
            bodies.clashes[rows] += ~is_counted[rows]
            is_counted[rows] = True
            depths = watch.measured(clash, poses, deviations).depths
            deepest = rows[depths > bodies.depth[rows]]
            bodies.depth[rows] = np.maximum(bodies.depth[rows], depths)
            bodies.part[deepest], bodies.other[deepest] = part, other
    return bodies
