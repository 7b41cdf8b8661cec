"""Counts of how often each contact point touches, made where realizations are simulated."""

from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation import Program
from tolcontact.contact import kernel
from tolcontact.discretization import Nominal
from tolcontact.simulation.block import Block
from tolcontact.vocabulary import CORRECTED

TOUCHING_GAP = 1e-4  # mm: a point with a smaller gap touches
MAX_REALIZATIONS = 2048
MAX_GAPS = 20_000_000  # of all points in all realizations


class TouchingCounts(NamedTuple):
    """In how many realizations each contact point touches, `points` (point,), and the number of realizations looked at."""

    points: Int[Array, " point"]
    realizations: int


def counted_realizations(nominal: Nominal) -> int:
    """Return the number of realizations, the first ones of a run, in which touching points are counted."""
    points = sum(len(pair.P_m) for pair in nominal.pairs)
    return min(MAX_REALIZATIONS, -(-MAX_GAPS // max(points, 1)))


def gaps_need_deviations(nominal: Nominal) -> bool:
    """Return whether gaps follow from poses together with deviations only: of supports, and of faces that deviate."""
    return any(pair.is_supports or any(face is not None for face in pair.deviating) for pair in nominal.pairs)


def count_in_block(program: Program, block: Block, end: int) -> TouchingCounts:
    """Return the counts of those realizations of a block that stand before the realization `end`.

    Realizations whose contact points were projected again are left out: they have other points than the model.
    """
    rows = np.flatnonzero(block.searched[: max(end - block.start, 0)] == 0)
    return count_touching(program, block.poses[rows, CORRECTED], block.deviations[rows])


def count_touching(
    program: Program, poses: Float[Array, "n part 12"], deviations: Float[Array, "n contributor"]
) -> TouchingCounts:
    """Return the counts at corrected poses (realization, part, 12), for deviations (realization, contributor)."""
    counts = [np.zeros(len(pair.P_m), dtype=np.int64) for pair in program.nominal.pairs]
    if len(poses) and counts:
        relative = program.observe(poses=poses, deviations=deviations)["relative"].reshape(len(poses), len(counts), -1)
        for k, (gaps, points) in enumerate(zip(program.gaps, counts, strict=True)):
            X_RM = np.ascontiguousarray(relative[:, k])
            if gaps is None:
                distances = program.round_gaps[k](X_RM=X_RM, deviations=deviations)["distances"]
                points[:] = (distances < TOUCHING_GAP).sum(axis=0)
            else:
                kernel.count_below(gaps.basis, gaps.columns, gaps.coordinates, X_RM, deviations, TOUCHING_GAP, points)
    return TouchingCounts(np.concatenate([np.zeros(0, dtype=np.int64), *counts]), len(poses))
