"""Discretize: declared shapes become locator points, contact points and surfaces in the nominal assembly frame."""

from tolcontact.discretization.discretizing import discretize
from tolcontact.discretization.locators import Locators
from tolcontact.discretization.nominal import ContactPoints, Nominal, NominalPart
from tolcontact.discretization.offsets import Offsets

__all__ = ["ContactPoints", "Locators", "Nominal", "NominalPart", "Offsets", "discretize"]
