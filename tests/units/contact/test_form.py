"""Insides of `contact` under the claims of `tests/test_form.py`."""

import numpy as np

from tests.cases.seats import seat
from tests.helpers import compiled
from tests.units.contact import plain_scan
from tolcontact.contact.raised_scan import raised_scan
from tolcontact.contact.scan import pair_scan


def test_heights_that_are_summed_up_once_give_the_same_deepest_points():
    program = compiled(seat())
    pair, gaps = program.nominal.pairs[0], program.gaps[0]
    deviations = program.draws(seed=3, start=0, stop=50)
    poses = program.place(deviations=deviations)["poses"]
    relative = program.observe(poses=poses, deviations=deviations)["relative"].reshape(50, -1, 12)[:, 0]
    scan = pair_scan(pair, gaps, (), 8)
    raised = raised_scan(scan, deviations).take(np.arange(49, -1, -1))
    actual, expected = (
        raised.deepest(relative[::-1], deviations[::-1]),
        plain_scan.deepest(scan, relative[::-1], deviations[::-1]),
    )
    assert (actual.points == expected.points).all() and expected.depth.max() > 0
    np.testing.assert_allclose(actual.depth, expected.depth, atol=1e-14)
    for one, other in zip(
        raised.rows(actual.points, deviations[::-1]), scan.rows(actual.points, deviations[::-1]), strict=True
    ):
        np.testing.assert_allclose(one, other, atol=1e-15)
