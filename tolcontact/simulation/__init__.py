"""Simulate: blocks of realizations through the compiled program."""

from tolcontact.simulation.block import Block
from tolcontact.simulation.blocks import simulate_block, simulate_blocks

__all__ = ["Block", "simulate_block", "simulate_blocks"]
