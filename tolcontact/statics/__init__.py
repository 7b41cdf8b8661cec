"""Balance of forces in the assembly as drawn, with Coulomb friction at its contacts.

A contact holds a part by a normal force N >= 0 and a friction force of at most mu N across it. One-sided locators and contact
pairs that touch in the assembly as drawn are such contacts. Two-sided locators guide: they push and pull, without friction.
"""

from tolcontact.statics.critical_friction import Balance, Seat, balances
from tolcontact.statics.touching import Contact, Touching, touching_contacts

__all__ = ["Balance", "Contact", "Seat", "Touching", "balances", "touching_contacts"]
