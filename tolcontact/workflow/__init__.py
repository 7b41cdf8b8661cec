"""The whole workflow in Python: run, build, check, compare, summarize, and methods of results.

.. include:: ../guide/workflow.md
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
