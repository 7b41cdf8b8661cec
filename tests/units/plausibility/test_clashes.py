"""Insides of `plausibility` under the claims of `tests/test_clashes.py`."""

import tolcontact as tc
from tests.test_clashes import warned
from tolcontact.plausibility.trial_draws import TrialDraws


def test_bodies_that_come_near_nothing_are_silent():
    a = tc.Assembly("row")
    for k in range(60):
        part = a.part(f"part {k}", tc.Box(8, 8, 8), at=(10 * k, 0, 0))
        a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x")), tolerance=0.2)
    a.measure("x", part.point(0, 0, 0), along="x", tolerance=1)
    assert not warned(a)
    assert not TrialDraws.of(tc.build(a)).clashes
