"""Draw: tolerances become deviations of locators and features.

.. include:: ../guide/variation.md
"""

from tolcontact.variation.draws import Draws, GivenDraws, draw

__all__ = ["Draws", "GivenDraws", "draw"]
