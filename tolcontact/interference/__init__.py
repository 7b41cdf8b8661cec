"""Interference: whether closed bodies lie in each other, and how deep, by a test that is complete."""

from tolcontact.interference.neighbours import Interference, Neighbours, WayOut
from tolcontact.interference.watch import Clash, Watch, ordered

__all__ = ["Clash", "Interference", "Neighbours", "Watch", "WayOut", "ordered"]
