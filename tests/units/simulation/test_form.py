"""Insides of `simulation` under the claims of `tests/test_form.py`."""

import copy

import pytest

import tolcontact as tc
from tests.cases.seats import seat
from tests.helpers import SEATED, simulate
from tolcontact.simulation.surfaces import check_surfaces, warn_of
from tolcontact.vocabulary import CORRECTED


@pytest.fixture(scope="module")
def between_points():
    """The program of a seat, and its surfaces between contact points."""
    program, run = simulate(seat(), samples=60, solver="daqp", method=SEATED)
    return program, check_surfaces(program, run["poses"][:, CORRECTED], run["deviations"])


def test_faces_of_a_seat_do_not_penetrate_each_other_between_contact_points(between_points):
    _, surfaces = between_points
    assert 0 < surfaces.penetration[:, 0].max() < 1e-3


def test_a_warning_of_penetration_gives_half_the_spacing(between_points):
    program, surfaces = between_points[0], copy.deepcopy(between_points[1])
    surfaces.penetration[:] = 1.0
    with pytest.warns(
        tc.errors.ContactWarning, match=r'pair "seat": .*; place contact points closer together, such as spacing=2.4$'
    ):
        warn_of(program, surfaces)
    pair = program.nominal.pairs[0]
    assert pair.form_spacing / 2 == pytest.approx(2.4, abs=0.05)
