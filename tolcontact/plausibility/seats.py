"""Seats that parts may not reach at the stated friction."""

from collections.abc import Iterator

from tolcontact.plausibility.trial_draws import TrialDraws
from tolcontact.statics import balances, drawn_contacts


def unsure_seats(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each seat short of which the stated friction can hold its part."""
    assembly = draws.program.nominal.assembly
    if not assembly.forces or all(mu is None for mu in (assembly.mu, *(pair.mu for pair in assembly.pairs))):
        return
    touching = drawn_contacts(draws.program.nominal)
    for balance in balances(touching):
        for seat in balance.seats() if balance.is_pressed and balance.is_held else ():
            if seat.critical > 0 and seat.reserve <= 1:
                holders = ", ".join(f'"{touching.contacts[k].label}"' for k in (-seat.shares).argsort() if seat.shares[k] > 0)
                yield (
                    f'seat "{seat.contact.label}": the forces may not push the part onto it, since friction can hold it short '
                    f"of it: {seat.reserve:.3g} of the stated coefficients suffice, at {holders}; push harder along the seat, "
                    "let less friction carry, or state the coefficients that are there"
                )
