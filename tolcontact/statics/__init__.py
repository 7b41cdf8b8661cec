"""Balance of forces at the contacts of an assembly, with Coulomb friction.

A contact holds a part by a normal force N >= 0 and a friction force of at most mu N across it. One-sided locators and contact
pairs that touch are such contacts. Two-sided locators guide: they push and pull, without friction.
"""

from tolcontact.statics.critical_friction import Balance, Seat, balances
from tolcontact.statics.touching import TOUCH_SHARE, Contact, Touching, TouchingPlaces, contacts_at, drawn_contacts

__all__ = [
    "TOUCH_SHARE",
    "Balance",
    "Contact",
    "Seat",
    "Touching",
    "TouchingPlaces",
    "balances",
    "contacts_at",
    "drawn_contacts",
]
