"""A residual tells what was left undone: nothing is certified that was not brought to its end."""

from dataclasses import replace

import numpy as np
import pytest

from tests import cases, referee
from tests.helpers import PAPER, R_t, simulate
from tolcontact.contact import ContactResolver
from tolcontact.simulation import simulate_block
from tolcontact.vocabulary import CORRECTED, RAW, Status


def test_points_that_are_deeper_than_the_rows_of_the_qp_count():
    """One round of row generation is too few where other points go inside: those rows have not converged, and say how deep."""
    method = replace(PAPER, active_set="initial")  # every point that is active may need its row
    program, whole = simulate(cases.ra1(), samples=200, solver="daqp", method=method)
    assert np.isin(whole["status"], [Status.UNTOUCHED, Status.RESOLVED]).all()
    resolvers = [ContactResolver(program, group, max_rounds=1) for group in program.groups]
    cut = vars(simulate_block(program, whole["deviations"], resolvers=resolvers))
    R, t = R_t(cut["poses"])
    (pair,) = program.nominal.pairs
    inside = np.zeros(200)
    for k in range(200):
        may_carry = referee.gaps(pair, R[k, RAW], t[k, RAW]) < 1e-9
        after = referee.gaps(pair, R[k, CORRECTED], t[k, CORRECTED])[may_carry]
        inside[k] = -after.min(initial=0)
    left = inside > 1e-6
    assert left.sum() > 5
    assert (cut["status"][left] == Status.NOT_CONVERGED).all()
    assert cut["kkt_residual"][left] == pytest.approx(inside[left], rel=1e-3)
    assert np.isin(cut["status"][inside < 1e-10], [Status.UNTOUCHED, Status.RESOLVED]).all()
