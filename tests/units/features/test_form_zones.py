"""Insides of `features` under the claims of `tests/test_form_zones.py`."""

import numpy as np
import pytest
from scipy.optimize import linprog

import tolcontact as tc
from tests.helpers import nightly
from tests.test_form_zones import field_of
from tolcontact.features.minimum_zone import ZoneMember, minimum_widths


def width_by_programme(places, heights):
    """Width of the zone of a plane at places (place, 2): four unknowns of an LP in the coordinates of the face."""
    ones = np.ones((len(places), 1))
    rows = np.vstack([np.hstack([ones, places, 0 * ones]), np.hstack([-ones, -places, -ones])])
    limits = np.concatenate([heights, -heights])  # lower plane <= heights <= lower plane + width
    return linprog([0, 0, 0, 1], A_ub=rows, b_ub=limits, bounds=[(None, None)] * 3 + [(0, None)], method="highs").fun


@pytest.mark.parametrize("faces", [200, *nightly(1000)])
def test_the_least_zone_is_that_of_a_linear_programme(faces):
    field = field_of(tc.Form())
    heights = np.random.default_rng(1).normal(size=(faces, field.modes)) @ field.heights(field.places).T
    widths = minimum_widths(field.zone, heights)
    expected = [width_by_programme(field.places[:, :2], of_one) for of_one in heights]
    np.testing.assert_allclose(widths, expected, rtol=1e-6)


def test_the_least_zone_by_closed_form():
    """A bowl over a square needs its depth, a saddle twice its height, a plane nothing."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21)))
    heights = np.array([x**2 + y**2, x * y, 3 * x - 2 * y + 1])
    zone = [ZoneMember(np.arange(len(x)), np.column_stack([x**0, x, y]))]
    np.testing.assert_allclose(minimum_widths(zone, heights), [2, 2, 0], rtol=1e-6, atol=1e-6)
