"""Sums over the realizations of a run: displacement fields, and counts of touching contact points."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive import ArchiveWriter, Run, row_values
from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation import Program
from tolcontact.contact import pair_search
from tolcontact.discretization import Nominal
from tolcontact.simulation import Block, ProgramFunction
from tolcontact.statistics import BlockSums, DisplacementFields, TouchingShares
from tolcontact.vocabulary import CORRECTED

MAX_REALIZATIONS = 2048
MAX_GAPS = 20_000_000  # of all points in all realizations


class TouchingCounts(NamedTuple):
    """The counts of contacts at each contact point, `points` (point,), and the number of realizations."""

    points: Int[Array, " point"]
    realizations: int


def counted_realizations(nominal: Nominal) -> int:
    """Return the number of realizations at the start of a run that are used for counting touching points."""
    points = sum(len(pair.P_m) for pair in nominal.pairs)
    return min(MAX_REALIZATIONS, -(-MAX_GAPS // max(points, 1)))


def count_touching(
    program: Program, poses: Float[Array, "n part 12"], deviations: Float[Array, "n contributor"]
) -> TouchingCounts:
    """Return the counts at corrected poses (realization, part, 12), for deviations (realization, contributor)."""
    counts = [np.zeros(len(pair.P_m), dtype=np.int64) for pair in program.nominal.pairs]
    if len(poses) and counts:
        _, relative = program.observed(poses, deviations)
        for k, pair in enumerate(program.nominal.pairs):
            if not pair.elastic:
                X_RM = np.ascontiguousarray(relative[:, k])
                counts[k] = pair_search(program, k).touching_counts(X_RM, deviations, terms.TOUCHING_GAP)
    return TouchingCounts(np.concatenate([np.zeros(0, dtype=np.int64), *counts]), len(poses))


BlockTotals = tuple[BlockSums, TouchingCounts]
ReducedBlock = tuple[dict[str, np.ndarray], BlockTotals]


@dataclass(frozen=True, eq=False)
class _BlockReduction(ProgramFunction):
    """Reduction of a block, where it is simulated, to stored rows and sums.

    kept      labels of the stored variables
    counted   number of realizations, starting with the first, for counting touching points
    """

    kept: tuple[str, ...]
    fields: DisplacementFields
    counted: int

    def __call__(self, program: Program, block: Block) -> ReducedBlock:
        # Reprojected contact points differ from the points of the model.
        rows = np.flatnonzero(block.searched[: max(self.counted - block.start, 0)] == 0)
        counts = count_touching(program, block.poses[rows, CORRECTED], block.deviations[rows])
        return row_values(block, self.kept, program.nominal), (
            self.fields.sums(block.poses, block.start, block.status, block.load),
            counts,
        )


class RunSums:
    """The sums of one run."""

    def __init__(self, program: Program, run: Run) -> None:
        self._program, self._seed = program, run.seed
        bending = program.bending
        self._fields = DisplacementFields(program.nominal, str(run.fields), bending.parts if bending else None)
        pairs = program.nominal.pairs  # without pairs of elastic parts, which touch where they are bent
        self._is_counted = np.concatenate([np.zeros(0, dtype=bool), *(np.full(len(p.P_m), not p.elastic) for p in pairs)])

    @property
    def sizes(self) -> list[int]:
        """The number of sums for the field of each part, in one state."""
        return self._fields.sizes

    @property
    def numbers(self) -> list[np.ndarray]:
        """The sums of the fields, for each part (state, number), as stored in a checkpoint."""
        return self._fields.numbers

    def start_from(self, writer: ArchiveWriter) -> None:
        """Start from the last checkpoint of an archive, if it has one."""
        kept = {row.variable for row in writer.kept}
        # Touching points are counted only if a reader of the archive could recompute the gaps.
        pairs = self._program.nominal.pairs
        need_deviations = any(pair.is_supports or any(face is not None for face in pair.deviating) for pair in pairs)
        is_known = terms.ROTATION in kept and (terms.DEVIATION in kept or not need_deviations)
        counted = counted_realizations(self._program.nominal) if is_known else 0
        self.of_blocks = _BlockReduction(tuple(row.label for row in writer.kept), self._fields, counted)
        self._fields.resume_from(writer.sums)
        self._touching = TouchingShares(self._is_counted)
        if end := min(writer.rows, counted):
            rows, poses = writer.first_poses(end)
            self._touching.add(*count_touching(self._program, poses, self._program.draws.rows(rows, seed=self._seed)))

    def merge(self, sums: BlockTotals) -> None:
        """Add the sums of the next block."""
        fields, counts = sums
        self._fields.merge(fields)
        self._touching.add(*counts)

    @property
    def groups(self) -> dict[str, dict[terms.ArchiveVariable, Any]]:
        """The fields and shares over the realizations so far, as groups of an archive."""
        parts = [terms.field_of(part.name) for part in self._program.nominal.last_parts]
        touching = dict(zip(terms.TOUCHING, self._touching.values(), strict=True))
        return dict(zip(parts, self._fields.fields(), strict=True)) | {"contact": touching}
