"""The archive: a netCDF file that holds a run, its realizations and the model.

.. include:: ../guide/archive.md
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
