"""The least friction at which a part can be held short of each locator and each face that it touches."""

from pathlib import Path

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import Question
from tolcontact.analyses.seated_contacts import seated_contacts
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.statics import Balance, Touching, balances, drawn_contacts
from tolcontact.workflow.models import Model

SEATED, DRAWN = "where the forces seat them", "as drawn, since the forces find no pose without friction"


def seating(model: Model | Program, *, into: str | Path | None = None) -> xr.Dataset:
    """Return the critical coefficient of friction of each locator and each contact pair of the parts that forces press.

        critical  (seat)          the least coefficient of friction, the same at all other contacts, at which these can hold the
                                  part short of the seat. Below it, the forces push the part onto the seat. It is 0 if the other
                                  contacts hold the part without friction, as where no force presses it against the seat, and
                                  infinite if no friction holds the part short of the seat
        reserve   (seat)          the least factor of the stated coefficients (`mu`) at which the other contacts can hold it: up
                                  to 1 the part may stop short. Not a number unless all of these state one
        share     (seat, holder)  the share that each contact then has in the sum of all normal forces: what holds the part; one
                                  distribution of several where it is not unique

    Parts stand where the forces seat them without deviations and without friction, in the exact resolution, for any method
    of the model. If they find no such pose, parts stand as drawn (attribute `place`). What touches there may carry: one-sided
    locators and contact pairs with friction, two-sided locators without. A contact that states mu=0 has no friction. Opposed
    contacts may press against each other as hard as the balance of forces allows, as in a drawer that jams. Whether a part does
    stop short depends on how it was put down, which nobody knows; the coefficient states whether it can. It is exact to 1e-6;
    where contacts can also press against each other without holding the forces, to 1e-3 (see tolcontact.statics).
    Arguments that all analyses share, and what they raise, are described in tolcontact.analyses.
    """
    question = Question(terms.SEATING, model, solver=None, method=None, into=into)
    if not question.program.nominal.assembly.forces:
        raise OptionError(
            f'"{question.assembly}" has no forces, so nothing presses its parts onto their seats; declare them: '
            'model.force("clamp", at=part.point(x, y, z), vector=(0, 0, -100))'
        )
    seated = seated_contacts(question.program)
    touching = seated or drawn_contacts(question.program.nominal)
    seats = [seat for balance in _pressed(question, touching) for seat in balance.seats()]
    labels = [contact.label for contact in touching.contacts]
    arrays = {
        "critical": np.array([seat.critical for seat in seats]),
        "reserve": np.array([seat.reserve for seat in seats]),
        "share": np.array([seat.shares for seat in seats]),
    }
    return question.dataset(
        arrays,
        {terms.SEAT: [seat.contact.label for seat in seats], terms.HOLDER: labels},
        open_pairs=", ".join(touching.open_pairs),
        place=SEATED if seated else DRAWN,
    )


def _pressed(question: Question, touching: Touching) -> list[Balance]:
    """Return the balances of parts that forces press. Raises OptionError if nothing holds their parts, even with friction."""
    pressed = [balance for balance in balances(touching) if balance.is_pressed]
    for balance in pressed:
        if not balance.is_held:
            parts = ", ".join(f'"{question.program.nominal.parts[part].name}"' for part in balance.parts)
            open_pairs = ", ".join(f'"{name}"' for name in touching.open_pairs)
            raise OptionError(
                f"nothing that touches holds {parts} against the forces, even with friction; check the vectors of the forces"
                + (f", and the contact pairs that do not touch: {open_pairs}" if open_pairs else "")
            )
    return pressed
