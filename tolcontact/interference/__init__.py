"""Interference of closed bodies, by a complete test.

.. include:: ../guide/interference.md
"""

from tolcontact.interference.neighbours import Interference, Neighbours, WayOut
from tolcontact.interference.solid import Solid, solid
from tolcontact.interference.watch import Clash, Watch, ordered

__all__ = [
    "Clash", "Interference", "Neighbours", "Solid", "Watch", "WayOut", "ordered", "solid",
]  # fmt: skip
