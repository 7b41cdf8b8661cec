"""The least friction at which a part can be held short of each locator and each face that it touches."""

from pathlib import Path

import numpy as np
import xarray as xr

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.analyses.analysis import Analysis
from tolcontact.compilation import Program, compile_program
from tolcontact.contact import pair_search
from tolcontact.errors import OptionError
from tolcontact.method import Method
from tolcontact.simulation import simulate_blocks
from tolcontact.statics import TOUCH_SHARE, Balance, Touching, TouchingPoints, balances, contacts_at, drawn_contacts
from tolcontact.variation import GivenDraws
from tolcontact.workflow.models import Model

SEATED, DRAWN = "where the forces seat them", "as drawn, since the forces find no pose without friction"


def seating(model: Model | Program, *, into: str | Path | None = None) -> xr.Dataset:
    """Return the critical coefficient of friction of each locator and each contact pair of the parts that forces press.

        critical  (seat)          the least coefficient of friction, the same at all other contacts, at which these can hold the
                                  part short of the seat. Below it, the forces push the part onto the seat. It is 0 if the other
                                  contacts hold the part without friction, for example if no force presses it against the seat,
                                  and infinite if no friction holds the part short of the seat
        reserve   (seat)          the least factor of the stated coefficients (`mu`) at which the other contacts can hold it: up
                                  to 1 the part may stop short. Not a number unless all of these state one
        share     (seat, holder)  the share of each contact in the sum of all normal forces at this coefficient, which shows the
                                  contacts that hold the part; one of several distributions where it is not unique

    Parts are in their poses as seated by the forces without deviations and without friction, in the exact resolution, for any
    method of the model. If there is no such pose, parts are in their poses as drawn (attribute `place`). Contacts that
    touch there may be active: unilateral locators and contact pairs with friction, bilateral locators without. A contact that
    states mu=0 has no friction. Opposed contacts may press against each other as hard as the balance of forces permits, as in a
    drawer that jams. Whether a part actually stops short depends on how it was put down, which is unknown; the coefficient
    states whether it can. It is exact to 1e-6, or to 1e-3 where contacts can also press against each other without holding the
    forces (see tolcontact.statics).
    `model` and `into` are as in all analyses (see tolcontact.analyses).

    `tc.analyses.seating("model.py", into="model.nc")`
    """
    question = Analysis(terms.SEATING, model, into=into)
    question.check_rigid("leave elastic out, or look at the reactions of a run")
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


def _pressed(question: Analysis, touching: Touching) -> list[Balance]:
    """Return the balances of parts that forces press. Raises OptionError if nothing can hold them, even with friction."""
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


def seated_contacts(program: Program) -> Touching | None:
    """Return the contacts at the pose of exact seating; None if there is no such pose."""
    seated = compile_program(program.nominal, program.solver.name, Method(resolution="exact", objective="seating"))
    deviations = np.zeros((1, len(program.nominal.contributors)))
    (block,) = simulate_blocks(seated, samples=1, seed=0, draws=GivenDraws(deviations), block=1)
    if block.status[0] not in terms.CERTIFIED:
        return None
    poses, pairs = block.poses[:, terms.CORRECTED], program.nominal.pairs
    _, relative = seated.observed(poses, deviations)
    places = []
    for k, pair in enumerate(pairs):
        if not pair.is_supports:
            assert pair.moving_face is not None and pair.reference_face is not None
            nearness = TOUCH_SHARE * max(pair.moving_face.mesh.scale, pair.reference_face.mesh.scale)
            points, normals = pair_search(seated, k).touching(relative[:, k], deviations, nearness)  # in the reference's frame
            X_WR = poses[0, pair.reference or 0]
            places.append(TouchingPoints(pose.apply(X_WR, points), normals @ pose.rotation(X_WR).T))
    return contacts_at(program.nominal, poses[0], places)
