"""Plot: pictures for papers and slides, with `tc.plot`. Needs `pip install '.[plot]'`.

.. include:: ../guide/plot.md
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
