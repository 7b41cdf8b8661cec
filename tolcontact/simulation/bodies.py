"""The watch over all bodies of a block: it withdraws certificates of penetrating pairs, and counts other clashes."""

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import Program
from tolcontact.interference import Clash

MAX_TRIANGLES = 1000  # of two bodies: with more, measuring their depth takes milliseconds
MEASURED_STEP = 16  # realizations: the depth of bodies with more triangles is measured in every 16th realization


@dataclass(frozen=True, eq=False)
class WatchedBodies:
    """Bodies that lie in each other, in n realizations.

    withdrawn   stations, and the rows (k,) where bodies with declared contact at the station lie in each other
    clashes     (n,) number of pairs of parts without declared contact that lie in each other
    depth       (n,) [mm]: penetration of the deepest of these pairs; 0 for none, NaN if it is not measured
    part, other (n,) indices of the parts of this pair in the assembly; -1 for none
    """

    clashes: Int[Array, " n"]
    depth: Float[Array, " n"]
    part: Int[Array, " n"]
    other: Int[Array, " n"]
    withdrawn: list[tuple[int, np.ndarray]] = field(default_factory=list)

    @classmethod
    def none(cls, count: int) -> "WatchedBodies":
        """Return `count` realizations without bodies that lie in each other."""
        return cls(np.zeros(count, dtype=int), np.zeros(count), np.full(count, -1), np.full(count, -1))

    def name(self, rows: Int[Array, " k"], depths: Float[Array, " k"], parts: tuple[int, int]) -> None:
        """Record two parts, with depths (k,) [mm], as the deepest pair in each of the rows (k,) where they are."""
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

    Pairs of bodies that were already `tested` are skipped where answers are certified. A pair of parts counts once, even if it
    penetrates in several stations. Pairs that penetrate nominally do not count. If no pair counts, bodies with declared contact
    are named where the answer is doubtful, or becomes doubtful because of them.
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
    """Return the indices of two bodies among the parts of the assembly, in ascending order."""
    part, other = sorted(program.nominal.number(index) for index in clash.pair)
    return part, other


def _depths(
    program: Program, clash: Clash, poses: Float[Array, "n part 12"], deviations: Float[Array, "n contributor"], start: int
) -> Float[Array, " k"]:
    """Return the penetration (k,) [mm] of two bodies; NaN in realizations where it is not measured, to save time.

    This choice depends only on the index of a realization in the run, so that results do not depend on the block size.
    """
    triangles = sum(len(program.nominal.parts[body].mesh.faces) for body in clash.pair)
    is_measured = np.full(len(clash.rows), triangles <= MAX_TRIANGLES) | ((start + clash.rows) % MEASURED_STEP == 0)
    depths = np.full(len(clash.rows), np.nan)
    measured = Clash(clash.pair, clash.rows[is_measured])
    depths[is_measured] = program.watch.measured(measured, poses, deviations).depths
    return depths
