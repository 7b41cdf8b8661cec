"""The equations, as CasADi expressions, one file each: poses, placement, gaps, corrections, objectives, measures."""

from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.gap_map import GapMap
from tolcontact.mechanics.groups import Group, round_pairs
from tolcontact.mechanics.pose import ENTRIES

__all__ = ["ENTRIES", "MOMENTS", "GapMap", "Group", "round_pairs"]
