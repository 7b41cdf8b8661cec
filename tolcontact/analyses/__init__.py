"""Analyse: what matters, what is rare, and which tolerances and positions suffice.

.. include:: ../guide/analyses.md
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
