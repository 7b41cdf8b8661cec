"""Zones of forms: the least zone by another method, and the share of faces inside by counting."""

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.stats import beta

import tolcontact as tc
from tests.cases.seats import seat
from tolcontact.features.least_zone import least_widths
from tolcontact.variation.form_spreads import FormSpread

FORMS = [tc.Form(), tc.Form(length=10), tc.Form("matern 5/2"), tc.Form("matern 3/2")]
SHARE = 0.9973002039367398


def field_of(form):
    return tc.build(seat(form)).nominal.features[0].form


def width_by_programme(places, heights):
    """Width of the zone of a plane at places (place, 2): four unknowns of an LP in the coordinates of the face."""
    ones = np.ones((len(places), 1))
    rows = np.vstack([np.hstack([ones, places, 0 * ones]), np.hstack([-ones, -places, -ones])])
    limits = np.concatenate([heights, -heights])  # lower plane <= heights <= lower plane + width
    return linprog([0, 0, 0, 1], A_ub=rows, b_ub=limits, bounds=[(None, None)] * 3 + [(0, None)], method="highs").fun


def test_the_least_zone_is_that_of_a_linear_programme():
    field = field_of(tc.Form())
    heights = np.random.default_rng(1).normal(size=(1000, field.modes)) @ field.heights(field.places).T
    widths = least_widths(field.places, heights)
    expected = [width_by_programme(field.places[:, :2], of_one) for of_one in heights]
    np.testing.assert_allclose(widths, expected, rtol=1e-6)


def test_the_least_zone_by_closed_form():
    """A bowl over a square needs its depth, a saddle twice its height, a plane nothing."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21)))
    places = np.column_stack([x, y, 0 * x])
    heights = np.array([x**2 + y**2, x * y, 3 * x - 2 * y + 1])
    np.testing.assert_allclose(least_widths(places, heights), [2, 2, 0], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_a_stated_share_of_faces_lies_inside(form):
    field, count, width = field_of(form), 200_000, 0.05
    spread = FormSpread(field).spread(width)
    rng, inside, modes = np.random.default_rng(7), 0, field.heights(field.places).T
    for _ in range(count // 2000):
        inside += int((least_widths(field.places, spread * rng.normal(size=(2000, field.modes)) @ modes) <= width).sum())
    lower, upper = beta.ppf([0.0005, 0.9995], [inside, inside + 1], [count - inside + 1, count - inside])
    assert lower < SHARE < upper


def test_modes_displace_no_face_as_a_whole_and_leave_little_out():
    for form, left_out in zip(FORMS, (2e-4, 0.16, 0.02, 0.06), strict=True):
        field = field_of(form)
        assert 0 < field.left_out < left_out
        x, y = (grid.ravel() for grid in np.meshgrid(*(np.linspace(0, size, 101)[:-1] + size / 200 for size in (100, 50))))
        heights = field.heights(np.column_stack([x, y, 0 * x]))
        moments = np.column_stack([np.ones(len(x)), x / 100, y / 50]).T @ heights / len(x)
        assert np.abs(moments).max() < 2e-3 * np.abs(heights).max()
        norms = heights.T @ heights / len(x)
        np.testing.assert_allclose(norms - np.diag(np.diag(norms)), 0, atol=5e-3 * norms.max())
        assert (np.diff(np.diag(norms)) < 1e-3).all()
