"""Assemblies with known answers, for several tests."""

from tests.cases.blocks import block_on_six, jaws, one_dimensional, ra1, square_pins, stack, stopped, tab
from tests.cases.declarations import everything_of_boxes, everything_of_meshes
from tests.cases.frames import MODELS, STILL, Frame, model
from tests.cases.locators import parked, translating
from tests.cases.rings import excess_of_hinged_ring, hinged_ring, ring, ring_opening
from tests.cases.round_bodies import ball_in_a_cone, bar_in_a_half_pipe, peg_in_a_hole, rollers, shaft_in_a_v
from tests.cases.tables import table

__all__ = [
    "MODELS", "STILL", "Frame", "ball_in_a_cone", "bar_in_a_half_pipe", "block_on_six", "everything_of_boxes",
    "everything_of_meshes", "excess_of_hinged_ring", "hinged_ring", "jaws", "model", "one_dimensional", "parked",
    "peg_in_a_hole", "ra1", "ring", "ring_opening", "rollers", "shaft_in_a_v", "square_pins", "stack", "stopped", "tab",
    "table", "translating",
]  # fmt: skip
