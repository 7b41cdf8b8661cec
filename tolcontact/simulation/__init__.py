"""Simulate: blocks of realizations through the compiled program."""

from tolcontact.simulation.block import Block
from tolcontact.simulation.blocks import simulate_block
from tolcontact.simulation.threads import block_rows, map_blocks, processors, simulate_blocks

__all__ = ["Block", "block_rows", "map_blocks", "processors", "simulate_block", "simulate_blocks"]
