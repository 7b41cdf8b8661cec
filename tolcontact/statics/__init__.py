"""Balance of forces at the contacts of an assembly, with Coulomb friction.

A contact acts on a part by a normal force N >= 0 and a tangential friction force of at most mu N. One-sided locators and
touching contact pairs are such contacts. Two-sided locators are guides: bilateral constraints without friction.
"""

from tolcontact.statics.critical_friction import Balance, Seat, balances
from tolcontact.statics.touching import TOUCH_SHARE, Contact, Touching, TouchingPoints, contacts_at, drawn_contacts

__all__ = [
    "TOUCH_SHARE", "Balance", "Contact", "Seat", "Touching", "TouchingPoints", "balances", "contacts_at", "drawn_contacts",
]  # fmt: skip
