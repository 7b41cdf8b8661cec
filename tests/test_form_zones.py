"""Zones of forms: the least zone by another method, and the share of faces inside by counting."""

import numpy as np
import pytest
from scipy.stats import beta

import tolcontact as tc
from tests.cases import toleranced
from tests.cases.seats import seat
from tests.helpers import nightly
from tests.population_referee import measured_back
from tolcontact.discretization import discretize
from tolcontact.variation import Draws

FORMS = [tc.Form(), tc.Form(length=10), tc.Form("matern 5/2"), tc.Form("matern 3/2")]
SHARE = 0.9973002039367398


def field_of(form):
    return discretize(seat(form)).features[0].form


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


def count_inside(needed, count):
    """Bounds of the share of faces, a number of which lie inside, in an interval of 99.9 %."""
    return beta.ppf([0.0005, 0.9995], [needed, needed + 1], [count - needed + 1, count - needed])


@pytest.mark.parametrize(("flatness", "spread"), [(0.1, 19.52), *nightly((0.05, 12.84))])
def test_form_and_displacements_share_the_zone_around_them(flatness, spread):
    nominal = discretize(toleranced.block_with("top", tc.Profile(0.2, "A|B|C"), tc.Flatness(flatness)))
    draws = Draws(nominal)
    own = {contributor.label: contributor.spread for contributor in draws.contributors}
    assert own["block.top.offset"] == own["block.top.tilt x"] == pytest.approx(0.2 / spread, rel=0.015)
    (top,) = (feature for feature in nominal.features if feature.feature.name == "top")
    count, inside, modes = 200_000, 0, top.form.heights(top.form.places)
    x, y = (top.form.places - top.geometry.centre)[:, :2].T
    labels = nominal.contributors
    places = [labels.index(f"block.top.{name}") for name in ("offset", "tilt x", "tilt y")]
    for start in range(0, count, 4000):
        drawn = draws(seed=5, start=start, stop=start + 4000)
        offset, tilt_x, tilt_y = drawn[:, places].T[..., None]
        heights = drawn[:, top.form_columns] @ modes.T + offset + tilt_x * y / 25 - tilt_y * x / 50
        inside += int((2 * np.abs(heights).max(axis=1) <= 0.2).sum())
    lower, upper = count_inside(inside, count)
    assert lower < SHARE < upper


def test_a_form_that_fills_the_zone_around_it_is_refused():
    with pytest.raises(tc.ModelError, match="the narrower tolerances within it leave 2 % of the"):
        tc.build(toleranced.block_with("top", tc.Profile(0.2, "A|B|C"), tc.Flatness(0.15)))
    with pytest.raises(tc.ModelError, match='the rule "translation" is for features that keep their shape'):
        tc.build(toleranced.block_with("top", tc.Profile(0.2, "A", rule="translation"), tc.Flatness(0.1)))


def test_a_population_is_measured_with_its_form():
    population = measured_back(toleranced.block_with("top", tc.Profile(0.2, "A|B|C"), tc.Flatness(0.1)), 3000)
    assert population.tolerances == ["flatness 0.1; 99.73 % inside", "profile 0.2 A B C; 99.73 % inside"]
    assert (population.stated_share == 0.9973).all()
    assert (population.lower <= 0.9973).all() and (population.upper >= 0.9973).all()
    assert population.needed_width == pytest.approx([0.1, 0.2], rel=0.06)


def test_a_profile_without_datums_is_the_form_of_a_plane():
    spreads = [
        [contributor.spread for contributor in Draws(discretize(toleranced.block_with("top", tolerance))).contributors]
        for tolerance in (tc.Flatness(0.1), tc.Profile(0.1), tc.LineProfile(0.1))
    ]
    assert len(spreads[0]) == 20 and spreads[0] == spreads[1] == spreads[2]
    assert not len(Draws(discretize(toleranced.block_with("top", tc.Profile(0.1, form=None)))).contributors)
