"""Sample: tolerances become deviations of the locators."""

from tolcontact.variation.draws import draw

__all__ = ["draw"]
