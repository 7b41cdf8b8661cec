"""Sums over the realizations of a run: displacement fields, and counts of touching contact points."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive import ArchiveWriter, Run, row_values
from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation import Program
from tolcontact.contact import pair_search
from tolcontact.simulation import Block, ProgramFunction
from tolcontact.statistics import BlockSums, DisplacementFields, TouchingShares

MAX_COUNTED = 2048  # realizations whose touching points are counted
MAX_GAPS = 20_000_000  # of all points in all these realizations


class TouchingCounts(NamedTuple):
    """The counts of contacts at each contact point, `points` (point,), in a number of realizations."""

    points: Int[Array, " point"]
    realizations: int


def _count_touching(
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


@dataclass(frozen=True, eq=False)
class _BlockReduction(ProgramFunction):
    """Reduction of a block, where it is simulated, to stored rows and sums.

    kept      labels of the stored variables
    counted   number of realizations, starting with the first, for counting touching points
    """

    kept: tuple[str, ...]
    fields: DisplacementFields
    counted: int

    def __call__(self, program: Program, block: Block) -> tuple[dict[str, np.ndarray], BlockTotals]:
        # Reprojected contact points differ from the points of the model.
        rows = np.flatnonzero(block.searched[: max(self.counted - block.start, 0)] == 0)
        counts = _count_touching(program, block.poses[rows, terms.CORRECTED], block.deviations[rows])
        fields = self.fields.sums(block.poses, block.start, block.status, block.load)
        return row_values(block, self.kept, program.nominal), (fields, counts)


class RunSums:
    """The sums of one run.

    fields   the displacement fields of all parts; their sums are stored in checkpoints
    """

    def __init__(self, program: Program, run: Run) -> None:
        self._program, self._seed, bending = program, run.seed, program.bending
        self.fields = DisplacementFields(program.nominal, str(run.fields), bending.parts if bending else None)

    def start_from(self, writer: ArchiveWriter) -> None:
        """Start from the last checkpoint of an archive, if it has one."""
        program, pairs, kept = self._program, self._program.nominal.pairs, {row.variable for row in writer.kept}
        # Touching points are counted only if a reader of the archive could recompute the gaps.
        need_deviations = any(pair.is_supports or any(face is not None for face in pair.deviating) for pair in pairs)
        is_known = terms.ROTATION in kept and (terms.DEVIATION in kept or not need_deviations)
        points = max(sum(len(pair.P_m) for pair in pairs), 1)
        counted = min(MAX_COUNTED, -(-MAX_GAPS // points)) if is_known else 0
        self.of_blocks = _BlockReduction(tuple(row.label for row in writer.kept), self.fields, counted)
        self.fields.resume_from(writer.sums)
        # Pairs of elastic parts touch where they are bent.
        is_rigid = [np.full(len(pair.P_m), not pair.elastic) for pair in pairs]
        self._touching = TouchingShares(np.concatenate([np.zeros(0, dtype=bool), *is_rigid]))
        if end := min(writer.rows, counted):
            rows, poses = writer.first_poses(end)
            self._touching.add(*_count_touching(program, poses, program.draws.rows(rows, seed=self._seed)))

    def merge(self, sums: BlockTotals) -> None:
        """Add the sums of the next block."""
        fields, counts = sums
        self.fields.merge(fields)
        self._touching.add(*counts)

    @property
    def groups(self) -> dict[str, dict[terms.ArchiveVariable, Any]]:
        """The fields and shares over the realizations so far, as groups of an archive."""
        parts = [terms.field_of(part.name) for part in self._program.nominal.last_parts]
        touching = dict(zip(terms.TOUCHING, self._touching.values(), strict=True))
        return dict(zip(parts, self.fields.fields(), strict=True)) | {"contact": touching}
