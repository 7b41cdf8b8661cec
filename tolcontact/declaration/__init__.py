"""Declare: parts, how they are located, which faces may touch, and what is measured.

.. include:: ../guide/declaration.md
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
