"""Insides of `contact` under the claims of `tests/test_certificates.py`."""

import pytest

from tests import cases
from tests.helpers import SEATED, SEATED_ON_POINTS, nightly, simulate
from tests.test_certificates import largest_turn
from tolcontact.contact.acceptance import MAX_TURN
from tolcontact.vocabulary import CORRECTED, Status


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wedges", "solver", "samples", "method"),
    [
        (3, "daqp", 50, SEATED_ON_POINTS),  # where parts in conflict have few further starts
        *nightly((3, "daqp", 50, SEATED), (3, "daqp", 400, SEATED), (3, "qpoases", 400, SEATED), (6, "daqp", 400, SEATED)),
    ],
)
def test_a_ring_closes_where_its_angles_leave_room(wedges, solver, samples, method):
    """The excess of an impossible ring is left over, shared by the joints, to the second order of the angles."""
    program, run = simulate(cases.hinged_ring(wedges), samples=samples, solver=solver, method=method)
    excess = cases.excess_of_hinged_ring(program.nominal, run["deviations"])
    assert samples / 10 < (excess > 0).sum() < samples * 3 / 10
    assert ((run["status"] == Status.NOT_ASSEMBLABLE) == (excess > 0)).all()
    assert ((run["status"] == Status.RESOLVED) == (excess <= 0)).all()
    assert largest_turn(run)[run["status"] == Status.RESOLVED].max() < MAX_TURN
    left = -run["gap_min"][excess > 0, CORRECTED].min(axis=1)
    # The rim of the faces is 40 mm from the axis, the excess is told at 30.
    assert (left <= excess[excess > 0] * 40 / 30 * 1.01 + 1e-4).all() and (left > 0).all()
