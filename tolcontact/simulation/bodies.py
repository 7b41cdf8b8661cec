"""Bodies of a block that lie in each other, and how far contact moves parts off their rigid two-sided locators.

The watch over all bodies withdraws certificates of penetrating pairs, and counts other clashes.
"""

from collections.abc import Collection

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float
from tolcontact.compilation import Program
from tolcontact.discretization import Nominal
from tolcontact.interference import Clash
from tolcontact.vocabulary import CORRECTED, RAW

MAX_TRIANGLES = 1000  # of two bodies: with more, measuring their depth takes milliseconds
MEASURED_STEP = 16  # realizations: the depth of bodies with more triangles is measured in every 16th realization


def watched_bodies(
    program: Program,
    poses: Float[Array, "n part 12"],
    deviations: Float[Array, "n contributor"],
    *,
    start: int,
    tested: Collection[tuple[int, int]],
    is_doubtful: Bool[Array, " n"],
    is_certified: Bool[Array, " n"],
) -> tuple[dict[str, np.ndarray], list[tuple[int, np.ndarray]]]:
    """Return the clashes, with their depths and parts, at poses (n, part, 12) of realizations `start` to `start + n`.

    They are fields of Block by name. Also return stations with the rows (k,) where bodies with declared contact at the station
    lie in each other.
    Pairs of bodies that were already `tested` are skipped where answers are certified. A pair of parts counts once, even if it
    penetrates in several stations. Pairs that penetrate nominally do not count. If no pair counts, bodies with declared contact
    are named where the answer is doubtful, or becomes doubtful because of them.
    """
    watch, nominal, count = program.watch, program.nominal, len(poses)
    clashes, depth, part, other = np.zeros(count, dtype=int), np.zeros(count), np.full(count, -1), np.full(count, -1)

    def name_deepest(clash: Clash) -> None:
        """Name two bodies in the rows where they are the deepest pair."""
        rows, depths = clash.rows, _depths(program, clash, poses, deviations, start)
        is_deeper = (part[rows] < 0) | (np.nan_to_num(depths) > np.nan_to_num(depth[rows]))
        deepest = rows[is_deeper]
        depth[deepest], part[deepest], other[deepest] = depths[is_deeper], *_parts(program, clash)

    stations = [scene.station for scene in nominal.scenes] or [""]
    counted = dict[tuple[int, int], np.ndarray]()
    withdrawn, declared = list[tuple[int, np.ndarray]](), list[Clash]()
    for clash in watch.clashes(poses, deviations, left_out={*tested, *watch.overlapping}):
        rows = clash.rows
        if clash.pair in watch.declared:
            withdrawn.append((stations.index(nominal.parts[clash.pair[0]].station), rows))
            declared.append(clash)
        else:
            is_counted = counted.setdefault(_parts(program, clash), np.zeros(count, dtype=bool))
            clashes[rows] += ~is_counted[rows]
            is_counted[rows] = True
            name_deepest(clash)
    doubtful = np.flatnonzero(is_doubtful)
    if doubtful.size and tested:
        repeated = watch.clashes(poses[doubtful], deviations[doubtful], among=tested)
        declared += [Clash(clash.pair, doubtful[clash.rows]) for clash in repeated]
    for clash in declared:
        is_named = (clashes[clash.rows] == 0) & (is_doubtful | is_certified)[clash.rows]
        name_deepest(Clash(clash.pair, clash.rows[is_named]))
    return {"clashes": clashes, "clash_depth": depth, "clash_part": part, "clash_other": other}, withdrawn


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


def locator_variations(program: Program) -> Float[Array, " part"]:
    """Return the largest deviation [mm] of any rigid two-sided locator of each part; NaN for a part without one.

    It is half the range of the locator, together with the ranges of the features that displace it.
    """
    nominal, ranges = program.nominal, np.array([contributor.range for contributor in program.draws.contributors])
    largest = np.full(len(nominal.parts), np.nan)
    for index, part in enumerate(nominal.parts):
        columns = nominal.columns(index)
        for locator in np.flatnonzero(part.locators.exact):
            features, factors = part.locators.pushes(int(locator))
            reach = (ranges[columns[locator]] + np.abs(factors) @ ranges[features]) / 2
            largest[index] = np.fmax(largest[index], reach)
    return largest


def locator_offsets(nominal: Nominal, poses: Float[Array, "n state part 12"]) -> Float[Array, "n part"]:
    """Return the largest distance [mm] by which contact moved each part along a rigid two-sided locator; 0 without one.

    It is measured in the frame of the part that it is located on.
    """
    offsets = np.zeros((len(poses), len(nominal.parts)))
    for index, part in enumerate(nominal.parts):
        exact = np.flatnonzero(part.locators.exact) if part.movers else np.zeros(0, dtype=int)
        owners = np.array(part.owners)[exact] if part.owners else np.full(len(exact), index)
        for owner in np.unique(owners):
            own = exact[owners == owner]
            X = poses[:, :, owner] if part.parent is None else pose.relative(poses[:, :, owner], poses[:, :, part.parent])
            moved = pose.apply(X[:, CORRECTED] - X[:, RAW], part.locators.points[own])  # which is linear in the pose
            along = np.abs(np.einsum("nlx,lx->nl", moved, part.locators.directions[own]))
            np.maximum(offsets[:, index], along.max(axis=1), out=offsets[:, index])
    return offsets
