"""Analyse: what matters, what is rare, and which tolerances and positions suffice.

.. include:: ../guide/analyses.md
"""
