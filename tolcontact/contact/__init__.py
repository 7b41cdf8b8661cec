"""Resolve contact: which points touch, and where the parts come to rest."""
