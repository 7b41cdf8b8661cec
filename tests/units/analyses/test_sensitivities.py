"""Insides of `analyses` under the claims of `tests/test_sensitivities.py`."""

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tolcontact.analyses.sensitivities import SteppedDraws


def test_steps_do_not_depend_on_blocks():
    draws = tc.build(cases.ra1(), solver="daqp").draws
    stepped = SteppedDraws(draws, np.array([1, 4]), np.array([0.1, 0.2]))
    whole = stepped(seed=2, start=0, stop=50)
    assert np.array_equal(whole[13:31], stepped(seed=2, start=13, stop=31)) and stepped.size == 5
    own, up1, up4, down1, down4 = whole.reshape(10, 5, -1).transpose(1, 0, 2)
    assert np.array_equal(own, draws(seed=2, start=0, stop=10))
    for moved, column, step in ((up1, 1, 0.1), (up4, 4, 0.2), (down1, 1, -0.1), (down4, 4, -0.2)):
        assert (moved - own)[:, column] == pytest.approx(step) and np.abs(np.delete(moved - own, column, 1)).max() == 0
