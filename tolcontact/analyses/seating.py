"""The least friction at which a part can be held short of each locator and each face that it touches."""

from pathlib import Path

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import Question
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.statics import Balance, Touching, balances, touching_contacts
from tolcontact.workflow.models import Model


def seating(model: Model | Program, *, into: str | Path | None = None) -> xr.Dataset:
    """Return the critical coefficient of friction of each locator and each contact pair of the parts that forces press.

        critical  (seat)          the least coefficient of friction, the same at all other contacts, at which these can hold the
                                  part short of the seat. Below it, the forces push the part onto the seat. It is 0 if the other
                                  contacts hold the part without friction, as where no force presses it against the seat, and
                                  infinite if no friction holds the part short of the seat
        reserve   (seat)          the least factor of the stated coefficients (`mu`) at which the other contacts can hold it: up
                                  to 1 the part may stop short. Not a number unless all of these state one
        share     (seat, holder)  the share that each contact then has in the sum of all normal forces: what holds the part

    All parts stand as drawn, and what touches there may carry: one-sided locators and contact pairs with friction, two-sided
    locators without. A contact that states mu=0 has no friction. Opposed contacts may press against each other as hard as the
    balance of forces allows, as in a drawer that jams. Whether a part does stop short depends on how it was put down, which
    nobody knows; the coefficient states whether it can. It is exact to 1e-6 (see tolcontact.statics); where contacts can also
    press against each other without holding the forces, to 1e-3. Triangles of round faces touch if they are nearer than their
    distance from these faces.
    Arguments that all analyses share, and what they raise, are described in tolcontact.analyses.
    """
    question = Question(terms.SEATING, model, solver=None, method=None, into=into)
    touching = touching_contacts(question.program.nominal)
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
    )


def _pressed(question: Question, touching: Touching) -> list[Balance]:
    """Return the balances of parts that forces press. Raises OptionError if there are none, or if nothing holds their parts."""
    if not touching.force:
        raise OptionError(
            f'"{question.assembly}" has no forces, so nothing presses its parts onto their seats; declare them: '
            'model.force("clamp", at=part.point(x, y, z), vector=(0, 0, -100))'
        )
    pressed = [balance for balance in balances(touching) if balance.is_pressed]
    for balance in pressed:
        if not balance.is_held:
            parts = ", ".join(f'"{question.program.nominal.parts[part].name}"' for part in balance.parts)
            raise OptionError(
                f"nothing that touches in the assembly as drawn holds {parts} against the forces, even with friction; "
                f"check the vectors of the forces{_open_pairs(touching)}"
            )
    if not pressed:
        raise OptionError(f'the forces of "{question.assembly}" act on fixed parts only; let them press parts that are located')
    return pressed


def _open_pairs(touching: Touching) -> str:
    pairs = ", ".join(f'"{name}"' for name in touching.open_pairs)
    return f", and the contact pairs that do not touch as drawn: {pairs}" if pairs else ""
