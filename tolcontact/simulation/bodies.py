"""The watch over all bodies of a block: it withdraws certificates of pairs that lie in each other, and counts other clashes."""

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import Program
from tolcontact.interference import Clash

MAX_TRIANGLES = 1000  # of two bodies whose depth is measured in every realization; it takes milliseconds if there are more
MEASURED_STEP = 16  # realizations: that of others is measured where this divides the number of the realization


@dataclass(frozen=True, eq=False)
class WatchedBodies:
    """Bodies that lie in each other, in n realizations.

    withdrawn   stations, and the rows (k,) in which bodies with declared contact there lie in each other
    clashes     (n,) number of pairs of parts without declared contact that lie in each other
    depth       (n,) [mm]: how deep those of the deepest of these pairs do; 0 for none, NaN if it is not measured
    part, other (n,) their indices among the parts of the assembly; -1 for none
    """

    clashes: Int[Array, " n"]
    depth: Float[Array, " n"]
    part: Int[Array, " n"]
    other: Int[Array, " n"]
    withdrawn: list[tuple[int, np.ndarray]] = field(default_factory=list)

    @classmethod
    def none(cls, count: int) -> "WatchedBodies":
        """Return `count` realizations in which no bodies lie in each other."""
        return cls(np.zeros(count, dtype=int), np.zeros(count), np.full(count, -1), np.full(count, -1))

    def name(self, rows: Int[Array, " k"], depths: Float[Array, " k"], parts: tuple[int, int]) -> None:
        """Take two parts, with depths (k,) [mm], for the deepest ones in rows (k,) in which they are."""
        is_deeper = (self.part[rows] < 0) | (np.nan_to_num(depths) > np.nan_to_num(self.depth[rows]))
        deepest = rows[is_deeper]
        self.depth[deepest], self.part[deepest], self.other[deepest] = depths[is_deeper], *parts


def watched_bodies(
    program: Program,
    poses: Float[Array, "n part 12"],
    deviations: Float[Array, "n contributor"],
    *,
    start: int,
    tested: Collection[tuple[int, int]],
    is_doubtful: Bool[Array, " n"],
    is_certified: Bool[Array, " n"],
) -> WatchedBodies:
    """Return which bodies lie in each other at poses (n, part, 12) of realizations `start` to `start + n`.

    Pairs of bodies that were `tested` before are left out where answers are certified. A pair of parts counts once, also if it
    lies in each other in several stations. Pairs that do nominally do not count. Where none counts, bodies with declared
    contact are named whose answer is doubtful, or will be.
    """
    watch, nominal, count = program.watch, program.nominal, len(poses)
    stations = [scene.station for scene in nominal.scenes] or [""]
    counted = dict[tuple[int, int], np.ndarray]()
    bodies, declared = WatchedBodies.none(count), list[Clash]()
    for clash in watch.clashes(poses, deviations, left_out={*tested, *watch.overlapping}):
        rows, parts = clash.rows, _parts(program, clash)
        if clash.pair in watch.declared:
            bodies.withdrawn.append((stations.index(nominal.parts[clash.pair[0]].station), rows))
            declared.append(clash)
        else:
            is_counted = counted.setdefault(parts, np.zeros(count, dtype=bool))
            bodies.clashes[rows] += ~is_counted[rows]
            is_counted[rows] = True
            bodies.name(rows, _depths(program, clash, poses, deviations, start), parts)
    doubtful = np.flatnonzero(is_doubtful)
    if doubtful.size and tested:
        repeated = watch.clashes(poses[doubtful], deviations[doubtful], among=tested)
        declared += [Clash(clash.pair, doubtful[clash.rows]) for clash in repeated]
    for clash in declared:
        is_named = (bodies.clashes[clash.rows] == 0) & (is_doubtful | is_certified)[clash.rows]
        named = Clash(clash.pair, clash.rows[is_named])
        bodies.name(named.rows, _depths(program, named, poses, deviations, start), _parts(program, clash))
    return bodies


def _parts(program: Program, clash: Clash) -> tuple[int, int]:
    """Return the indices of two bodies among the parts of the assembly, the smaller one first."""
    part, other = sorted(program.nominal.number(index) for index in clash.pair)
    return part, other


def _depths(
    program: Program, clash: Clash, poses: Float[Array, "n part 12"], deviations: Float[Array, "n contributor"], start: int
) -> Float[Array, " k"]:
    """Return how deep (k,) [mm] two bodies lie in each other; NaN where that is not measured, since it would take long.

    Whether it is depends on the number of a realization alone, so that it is the same in every block.
    """
    triangles = sum(len(program.nominal.parts[body].mesh.faces) for body in clash.pair)
    is_measured = np.full(len(clash.rows), triangles <= MAX_TRIANGLES) | ((start + clash.rows) % MEASURED_STEP == 0)
    depths = np.full(len(clash.rows), np.nan)
    measured = Clash(clash.pair, clash.rows[is_measured])
    depths[is_measured] = program.watch.measured(measured, poses, deviations).depths
    return depths
