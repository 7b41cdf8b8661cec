"""Analyses of models whose locators and pairs give way, against closed forms."""

import numpy as np
import pytest
from scipy import integrate, stats

import tolcontact as tc
from tests.test_springs import LOAD, SIGMA, springy_table
from tests.test_springy_locators import bar_on_springs, by_stiffness_matrix
from tests.test_springy_pairs import padded_block

STIFFNESS, LIMIT = 1000.0, 0.22
SINK = LOAD / (4 * STIFFNESS)


def limited_table():
    model = springy_table(STIFFNESS)
    (height,) = model.measures
    return model.replaced(
        measures=[tc.declaration.Measure(height.name, height.of, height.to, height.along, None, limits=(-LIMIT, LIMIT))]
    )


@pytest.mark.nightly
def test_worst_cases_of_a_springy_table_are_its_highest_and_lowest_legs():
    worst = tc.analyses.worst_case(limited_table(), samples=64)["worst"].sel(state="corrected", measure="height")
    assert worst.values == pytest.approx([-3 * SIGMA - SINK, 3 * SIGMA - SINK], abs=1e-6)


def test_worst_cases_of_a_bar_agree_with_its_stiffness_matrix_at_all_corners():
    worst = tc.analyses.worst_case(bar_on_springs(), samples=64)["worst"].sel(state="corrected").values
    corners = 0.3 * np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
    ends = np.array([by_stiffness_matrix(corner)[0] for corner in corners])
    assert worst == pytest.approx(np.column_stack([ends.min(axis=0), ends.max(axis=0)]), abs=1e-5)


@pytest.mark.nightly
def test_legs_contribute_alike():
    shares = tc.analyses.contributions(limited_table(), samples=1024)["total"].sel(state="corrected", measure="height").values
    legs, others = shares[:4], shares[4:]
    assert (legs[:, 1] < legs[:, 0].mean()).all() and (legs[:, 0].mean() < legs[:, 2]).all()
    assert legs[:, 0].sum() > 1 and np.abs(others).max() < 1e-9


def test_sensitivities_of_a_bar_are_the_slopes_of_its_stiffness_matrix():
    slopes = (
        tc.analyses.sensitivities(bar_on_springs(), samples=8)["sensitivity"].sel(state="corrected", interval="estimate").values
    )
    assert slopes[:, :3].sum(axis=1) == pytest.approx(1, abs=1e-6)  # all springs higher by 1 lift the bar by 1


@pytest.mark.nightly
def test_tails_of_a_springy_table_agree_with_a_quadrature():
    tails = tc.analyses.tails(limited_table(), samples=40_000, solver="daqp")["probability"].values[0]
    normal = stats.norm(scale=SIGMA / 2)

    def outside(w):
        rise = max(0.0, abs(w) - SINK)
        return normal.pdf(w) * (normal.sf(LIMIT + SINK - rise) + normal.cdf(-LIMIT + SINK - rise))

    expected = 2 * integrate.quad(outside, 0, 0.5, points=[SINK])[0]
    assert tails[1] < expected < tails[2] and tails[0] == pytest.approx(expected, rel=0.1)


@pytest.mark.nightly
def test_a_seat_on_a_pad_is_that_on_a_rigid_one():
    springy, rigid = (tc.analyses.seating(padded_block(stiffness=stiffness))["critical"].values for stiffness in (1e9, None))
    assert np.isfinite(rigid).any() and springy == pytest.approx(rigid, abs=1e-6)
