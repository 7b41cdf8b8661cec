"""The equations: poses, gaps, the contact QP, and the objectives of the corrected pose.

.. include:: ../guide/mechanics.md
"""

from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.gap import GapMap
from tolcontact.mechanics.groups import Group, curved_pairs
from tolcontact.mechanics.pose import ENTRIES

__all__ = ["ENTRIES", "MOMENTS", "GapMap", "Group", "curved_pairs"]
