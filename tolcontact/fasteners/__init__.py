"""Fasten: bolts, screws, pins and dowels in the holes of several parts. A chapter of the guide."""

from tolcontact.fasteners.fastening import fasten

__all__ = ["fasten"]
