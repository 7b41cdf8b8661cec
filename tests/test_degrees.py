"""Angles in degrees, for arguments that take radians."""

import math

import numpy as np
import pytest

import tolcontact as tc
from tolcontact.discretization import discretize


def test_degrees_are_radians_in_the_form_of_arguments():
    assert tc.degrees(180) == math.pi
    assert tc.degrees(0, 0, 90) == (0.0, 0.0, math.pi / 2)
    assert tc.degrees(*np.array([-30.0, 60.0])) == pytest.approx((-math.pi / 6, math.pi / 3))


def test_a_part_turns_by_that_many_degrees():
    """A block of 30 x 20 x 10 that turns by 90 degrees about z lies in -20..0, 0..30."""
    model = tc.Assembly("turned")
    model.part("block", tc.Box(30, 20, 10), rotation=tc.degrees(0, 0, 90), fixed=True)
    model.measure("x", model.parts[0].point(0, 0, 0), along="x")
    body = discretize(model).parts[0].body
    assert body.bounds == pytest.approx(np.array([[-20, 0, 0], [0, 30, 10]]), abs=1e-12)


@pytest.mark.parametrize("wrong", ["90", (0, 0, 90), None, float("nan"), True])
def test_other_things_than_numbers_are_refused(wrong):
    with pytest.raises(TypeError, match=r"degrees of .*; expected finite numbers, as in tc\.degrees\(0, 0, 90\)"):
        tc.degrees(wrong)
