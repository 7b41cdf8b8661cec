"""Compile: poses, gaps and measures as CasADi expressions, and the one QP Function. CasADi stays in this folder."""

from tolcontact.symbolic.contact_program import SLOTS
from tolcontact.symbolic.gap_map import GapMap
from tolcontact.symbolic.groups import Group, round_pairs
from tolcontact.symbolic.objective import MOMENTS
from tolcontact.symbolic.plugins import ACCURACY, usable_plugins
from tolcontact.symbolic.pose import ENTRIES
from tolcontact.symbolic.program import ContactGroup, Program, compile_program

__all__ = [
    "ACCURACY",
    "ENTRIES",
    "MOMENTS",
    "SLOTS",
    "ContactGroup",
    "GapMap",
    "Group",
    "Program",
    "compile_program",
    "round_pairs",
    "usable_plugins",
]
