"""Report: tables for a terminal, pages for a browser, and views for notebooks.

.. include:: ../guide/report.md
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
