"""Insides of `report` under the claims of `tests/test_linear_shares.py`."""

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tolcontact.report.contributor_shares import contributor_shares


def test_a_stack_has_the_shares_of_its_tolerances():
    """The height of a block on three supports, by the lever of each: 6 sigma is the tolerance, so shares are squares."""
    a = tc.Assembly("block")
    block = a.part("block", tc.Box(60, 40, 10))
    places = {"A1": (0, 0), "A2": (60, 0), "A3": (30, 40)}
    pins = [
        tc.Locator(name, (*at, 0), (0, 0, 1), tolerance=width)
        for (name, at), width in zip(places.items(), (1, 2, 3), strict=True)
    ]
    pins += [
        tc.Locator(n, p, d, tolerance=0)
        for n, p, d in (("B1", (0, 0, 5), (0, 1, 0)), ("B2", (60, 0, 5), (0, 1, 0)), ("C", (0, 20, 5), (1, 0, 0)))
    ]
    a.locate(block, pins)
    a.measure("middle", block.point(30, 20, 0), along="z", tolerance=3)
    results = tc.run(a, samples=4000, seed=1)
    (shares,) = contributor_shares(results, 4000)
    levers = np.array([0.25, 0.25, 0.5]) * [1, 2, 3]  # of the middle between both ends
    expected = dict(zip(["block.A1", "block.A2", "block.A3"], levers**2 / (levers @ levers), strict=True))
    assert shares.groups == ["block.A3", "block.A2", "block.A1"]
    for name, (estimate, lower, upper) in zip(shares.groups, shares.shares, strict=True):
        assert estimate == pytest.approx(expected[name], abs=0.02) and lower - 0.01 <= expected[name] <= upper + 0.01
    assert "which explains 100" in shares.note


def test_reasons_are_sentences():
    few = tc.run(cases.stack(), samples=20, solver="daqp")
    assert "cannot be estimated from 20 realizations; at least 200 are needed" in contributor_shares(few, 20)[0].note
    without = tc.run(cases.stack(), samples=300, solver="daqp", keep="poses")
    assert "no deviations" in contributor_shares(without, 300)[0].note
