"""Resolve contact: which points touch, and where the parts come to rest."""

from tolcontact.contact.resolver import ContactResolver
from tolcontact.contact.state import Resolved

__all__ = ["ContactResolver", "Resolved"]
