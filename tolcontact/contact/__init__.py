"""Resolve contact: linearized or exact, starts and search, statuses, what a certificate covers, limits.

.. include:: ../guide/contact.md
"""

from tolcontact.contact.candidates import pair_search
from tolcontact.contact.resolver import ContactResolver
from tolcontact.contact.state import Resolved

__all__ = ["ContactResolver", "Resolved", "pair_search"]
