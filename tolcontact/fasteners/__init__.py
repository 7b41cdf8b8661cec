"""Fasten: bolts, screws, pins and dowels in the holes of several parts.

.. include:: ../guide/fasteners.md
"""

from tolcontact.fasteners.fastening import fasten

__all__ = ["fasten"]
