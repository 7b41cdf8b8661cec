"""Discretize: surfaces, contact points and locators of the nominal assembly, in its frame.

.. include:: ../guide/discretization.md
"""

from tolcontact.discretization.coordinates_in_words import coordinates_in_words
from tolcontact.discretization.discretizing import discretize
from tolcontact.discretization.fixed_contact import ContactPoints, Offsets
from tolcontact.discretization.following_contact import FollowingContact
from tolcontact.discretization.form_places import FIRST_POINT, raised_places, rim_points
from tolcontact.discretization.locators import Locators, NominalPart
from tolcontact.discretization.measured_planes import MeasuredPlanes, measured_planes
from tolcontact.discretization.nominal import Nominal
from tolcontact.discretization.round_contact import RoundContact
from tolcontact.discretization.round_points import RoundPoint, RoundPoints
from tolcontact.discretization.weld_pairs import Weld

__all__ = [
    "FIRST_POINT", "ContactPoints", "FollowingContact", "Locators", "MeasuredPlanes", "Nominal", "NominalPart", "Offsets",
    "RoundContact", "RoundPoint", "RoundPoints", "Weld", "coordinates_in_words", "discretize", "measured_planes",
    "raised_places", "rim_points",
]  # fmt: skip
