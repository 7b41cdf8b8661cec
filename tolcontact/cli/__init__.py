"""The command line: `tolcontact`, or `python -m tolcontact`.

.. include:: ../guide/cli.md
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
