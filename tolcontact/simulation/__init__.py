"""Simulation in blocks of realizations, on all processors, with results that do not depend on them.

.. include:: ../guide/simulation.md
"""

from tolcontact.simulation.block import Block, defined_measures, outcomes, simulate_block
from tolcontact.simulation.threads import ProgramFunction, block_rows, map_blocks, simulate_blocks
from tolcontact.system.machine import processors

__all__ = [
    "Block", "ProgramFunction", "block_rows", "defined_measures", "map_blocks", "outcomes", "processors", "simulate_block",
    "simulate_blocks",
]  # fmt: skip
