"""Sums over the realizations of a run: displacement fields, and how often contact points touch."""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive import ArchiveWriter, Run, stored
from tolcontact.archive.stored_rows import StoredBlock
from tolcontact.compilation import Program
from tolcontact.simulation import Block
from tolcontact.simulation.touching import (
    TouchingCounts,
    count_in_block,
    count_touching,
    counted_realizations,
    gaps_need_deviations,
)
from tolcontact.statistics import BlockSums, DisplacementFields, TouchingShares

ReducedBlock = tuple[StoredBlock, tuple[BlockSums, TouchingCounts]]


@dataclass(frozen=True, eq=False)
class _BlockReduction:
    """Reduction of a block, where it is simulated, to the rows that are stored and to sums.

    kept      names of the stored variables
    counted   number of realizations, from the first of the run, in which touching points are counted
    """

    kept: tuple[str, ...]
    fields: DisplacementFields
    counted: int

    def bound_to(self, program: Program) -> Callable[[Block], ReducedBlock]:
        """Return the function of a block of that program."""
        return functools.partial(self, program)

    def __call__(self, program: Program, block: Block) -> ReducedBlock:
        counts = count_in_block(program, block, self.counted)
        return stored(block, self.kept), (self.fields.sums(block.poses, block.start), counts)


class RunSums:
    """The sums of one run."""

    def __init__(self, program: Program, run: Run) -> None:
        self._program, self._seed = program, run.seed
        self._fields = DisplacementFields(program.nominal, run.fields)
        self._points = sum(len(pair.P_m) for pair in program.nominal.pairs)

    @property
    def sizes(self) -> list[int]:
        """The number of sums for the field of each part, in one state."""
        return self._fields.sizes

    @property
    def numbers(self) -> list[np.ndarray]:
        """The sums of the fields, for each part (state, number), as a checkpoint holds them."""
        return self._fields.numbers

    def start_from(self, writer: ArchiveWriter) -> bool:
        """Start from the last checkpoint of an archive, and return whether it has one."""
        kept = tuple(variable.name for variable in writer.kept)
        # Touching points are known only where a reader of the archive could compute gaps again.
        is_known = terms.ROTATION.name in kept and (
            terms.DEVIATION.name in kept or not gaps_need_deviations(self._program.nominal)
        )
        counted = counted_realizations(self._program.nominal) if is_known else 0
        self.of_blocks = _BlockReduction(kept, self._fields, counted)
        checkpoint = writer.take_up()
        self._fields.go_on_from(checkpoint)
        self._touching = TouchingShares(self._points)
        if end := min(writer.rows, counted):
            rows, poses = writer.first_poses(end)
            self._touching.add(*count_touching(self._program, poses, self._program.draws.rows(rows, seed=self._seed)))
        return bool(checkpoint)

    def merge(self, sums: tuple[BlockSums, TouchingCounts]) -> None:
        """Add the sums of the next block."""
        fields, counts = sums
        self._fields.merge(fields)
        self._touching.add(*counts)

    def write_to(self, writer: ArchiveWriter) -> None:
        """Write fields and shares of the realizations so far."""
        writer.write_fields(self._fields.fields())
        if self._touching.is_new:
            writer.write_touching(*self._touching.values())
