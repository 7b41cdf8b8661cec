"""Discretize: declared shapes become locator points, contact points and surfaces in the nominal assembly frame."""

from tolcontact.discretization.nominal import ContactPoints, Nominal, NominalPart, discretize, movers

__all__ = ["ContactPoints", "Nominal", "NominalPart", "discretize", "movers"]
