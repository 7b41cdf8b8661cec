"""Insides of `analyses` under the claims of `tests/test_shared_causes.py`."""

import numpy as np
import pytest

import tolcontact as tc
from tests.test_datums import plate
from tolcontact.analyses.contributions import MixedDraws
from tolcontact.analyses.sensitivities import SteppedDraws


def labels_of(model):
    program = tc.build(model, solver="daqp")
    return program, list(program.nominal.contributors)


def test_designs_combine_what_causes_drive_and_do_not_depend_on_blocks():
    a = plate("outside")
    a.variable("warp", 0.2, drives={"plate.side.tilt z": 1.0, "plate.far.offset": -2.0})
    program, labels = labels_of(a)
    draws, tilt, offset, cause = program.draws, *map(labels.index, ("plate.side.tilt z", "plate.far.offset", "warp"))
    stepped, mixed = (
        SteppedDraws(draws, np.array([tilt, cause]), np.array([0.01, 0.02])),
        MixedDraws(draws, [np.array([cause])]),
    )
    for design in (stepped, mixed):
        assert np.array_equal(design(seed=2, start=0, stop=60)[17:41], design(seed=2, start=17, stop=41))
    members = stepped.members(2, 0, 50)
    up, down = members[:, 2] - members[:, 0], members[:, 4] - members[:, 0]
    assert up[:, [tilt, offset, cause]] == pytest.approx(np.tile([0.02, -0.04, 0.02], (50, 1)))
    assert down[:, [tilt, offset, cause]] == pytest.approx(np.tile([-0.02, 0.04, -0.02], (50, 1)))
    assert np.abs(members[:, 1] - members[:, 0])[:, np.arange(len(labels)) != tilt].max() == 0
    A, B, mixture = mixed.members(2, 0, 50).transpose(1, 0, 2)
    assert np.array_equal(A, draws(seed=2, start=0, stop=50)) and np.array_equal(mixture[:, cause], B[:, cause])
    change = B[:, cause] - A[:, cause]
    assert (mixture - A)[:, [tilt, offset]] == pytest.approx(np.outer(change, [1, -2]))
    for rows in (members[:, 2], mixture):  # the datum that follows from the tilt has shifted with it
        again = rows.copy()
        draws.add_shifts(again)
        assert np.array_equal(again, rows)
