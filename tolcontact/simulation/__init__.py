"""Simulate: blocks of realizations through the compiled program."""

from tolcontact.simulation.block import CORRECTED, RAW, Block, Status
from tolcontact.simulation.blocks import simulate_block, simulate_blocks

__all__ = ["CORRECTED", "RAW", "Block", "Status", "simulate_block", "simulate_blocks"]
