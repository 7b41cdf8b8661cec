"""Summarize: estimates of measures, contact and displacement fields, with their intervals.

.. include:: ../guide/statistics.md
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
