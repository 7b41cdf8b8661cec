"""Insides of `analyses` under the claims of `tests/test_contributions.py`."""

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, compiled
from tests.test_contributions import of_normal
from tolcontact.analyses.analysis import independent_groups
from tolcontact.analyses.contributions import MixedDraws, ReleasedDraws
from tolcontact.analyses.linear_model import linear_model


def test_mixtures_do_not_depend_on_blocks_and_exchange_columns():
    draws = tc.build(cases.ra1(), solver="daqp").draws
    mixed = MixedDraws(draws, [np.array([0]), np.array([3, 5])])
    whole = mixed(seed=2, start=0, stop=40)
    assert np.array_equal(whole[7:23], mixed(seed=2, start=7, stop=23))
    A, B, first, second = whole.reshape(10, 4, -1).transpose(1, 0, 2)
    assert np.array_equal(A, draws(seed=2, start=0, stop=10)) and not (A == B).any()
    assert np.array_equal(first[:, 0], B[:, 0]) and np.array_equal(np.delete(first, 0, 1), np.delete(A, 0, 1))
    assert np.array_equal(second[:, [3, 5]], B[:, [3, 5]]) and np.array_equal(second[:, :3], A[:, :3])


def test_what_is_drawn_together_is_one_group():
    a = cases.stack()
    a.correlate(["upper.A1", "middle.A1"], [[1, 0.8], [0.8, 1]])
    program = compiled(a, solver="daqp")
    labels = list(program.nominal.contributors)
    groups = independent_groups(program.draws, labels, np.ones(len(labels), dtype=bool))
    assert "middle.A1 + upper.A1" in groups or "upper.A1 + middle.A1" in groups
    assert sorted(k for columns in groups.values() for k in columns) == list(range(len(labels)))
    by_part = tc.analyses.contributions(a, samples=16, solver="daqp", by="part")
    assert by_part.sizes["group"] == 2 and "bottom" in by_part["group"].values


CORRELATED = ["upper.A3", "middle.A1", "upper.A1"]
MATRIX = [[1, 0.8, -0.3], [0.8, 1, 0.1], [-0.3, 0.1, 1]]


@pytest.mark.slow
def test_shapley_effects_divide_what_is_correlated():
    """Against the closed form: also of a locator that the measure does not follow; it is correlated with one it follows."""
    rho, first, second = 0.5, 1, 2  # Owen, Prieur (2017), two numbers
    own = (first**2 * (1 - rho**2 / 2) + rho * first * second + second**2 * rho**2 / 2) / 7
    assert of_normal([first, second], [[1, rho], [rho, 1]]) == pytest.approx([own, 1 - own])
    a = cases.stack()
    a.correlate(CORRELATED, MATRIX)
    program = compiled(a, solver="daqp", method=PAPER)
    found = tc.analyses.contributions(program, samples=4096).sel(measure="top")
    columns = [list(program.nominal.contributors).index(label) for label in (*CORRELATED, "upper.A2")]
    slopes = linear_model(program).by_deviations[0, columns]
    matrix = np.eye(4)
    matrix[:3, :3] = MATRIX
    for label, truth in zip((*CORRELATED, "upper.A2"), of_normal(slopes, matrix), strict=True):
        estimate, lower, upper = found["shapley"].sel(state="raw", unit=label).values
        assert abs(estimate - truth) < 1.7 * (upper - lower) / 2 + 1e-3 and truth > 0.05, label
    assert found["shapley"].sel(interval="estimate").sum("unit").values == pytest.approx([1, 1])
    assert found.sizes["unit"] == found.sizes["group"] + 2
    assert tc.analyses.contributions(program, samples=16, by="part").sizes["unit"] == 3


def test_released_draws_do_not_depend_on_blocks_and_keep_correlations():
    a = cases.stack()
    a.correlate(CORRELATED, MATRIX)
    program = compiled(a, solver="daqp")
    labels = list(program.nominal.contributors)
    columns = [labels.index(label) for label in CORRELATED]
    released = ReleasedDraws(
        program.draws, independent_groups(program.draws, labels, np.ones(len(labels), dtype=bool), correlated=False)
    )
    whole = released(seed=2, start=0, stop=19 * 3000)
    assert np.array_equal(whole[37:777], released(seed=2, start=37, stop=777))
    rows = whole.reshape(3000, 19, -1)
    assert np.abs(rows[:, -1] - program.draws(seed=2, start=0, stop=3000)).max() < 1e-9
    for members in (0, 9, 18):
        assert np.corrcoef(rows[:, members, columns].T) == pytest.approx(np.array(MATRIX), abs=0.06)
    places = released.positions(2, 0, 3000)
    kept = np.isclose(rows[:, 9], rows[:, -1], atol=1e-9)[:, labels.index("upper.A2")]
    assert np.array_equal(kept, places[:, labels.index("upper.A2")] < 9)
