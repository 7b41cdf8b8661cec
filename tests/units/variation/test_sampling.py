"""Insides of `variation` under the claims of `tests/test_sampling.py`."""

import numpy as np

from tests import cases
from tolcontact.discretization import discretize
from tolcontact.variation import draw
from tolcontact.variation.plans import STREAM, uniform


def test_a_draw_depends_on_seed_and_number_only():
    nominal = discretize(cases.ra1())
    everything = draw(nominal, seed=5, start=0, stop=3 * STREAM)
    for start, stop in ((0, 1), (7, 20), (STREAM - 1, STREAM + 1), (STREAM, 2 * STREAM), (5000, 9001)):
        assert (draw(nominal, seed=5, start=start, stop=stop) == everything[start:stop]).all()
    assert (draw(nominal, seed=6, start=0, stop=100) != everything[:100]).all()


def test_shares_are_in_the_middle_of_the_steps_that_a_draw_may_take():
    """Odd multiples of 2^-53: neither 0 nor 1, whose quantiles are infinite for many distributions, and without a bias."""
    shares = uniform(1, "block.A1", 0, 5000)
    multiples = (shares * 2.0**53).astype(np.int64)
    assert (multiples == shares * 2.0**53).all() and (multiples % 2 == 1).all()
