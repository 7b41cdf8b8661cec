"""Draw: tolerances become deviations of locators and features.

.. include:: ../guide/variation.md
"""

from tolcontact.variation.contributors import Contributor
from tolcontact.variation.draws import Draws, GivenDraws, draw

__all__ = ["Contributor", "Draws", "GivenDraws", "draw"]
