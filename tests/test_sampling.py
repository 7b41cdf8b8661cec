"""Draws: their distributions, and that realization k depends on seed, locator and k alone."""

import numpy as np
import pytest
from scipy import stats

import tolcontact as tc
from tests import cases
from tolcontact.discretization import discretize
from tolcontact.variation import draw

SHAPES = {
    "normal": stats.norm(0, 0.5),
    "uniform": stats.uniform(-1.5, 3),
    "triangular": stats.triang(0.5, -1.5, 3),
    "truncated normal": stats.truncnorm(-3, 3, 0, 0.5),
}


def one_locator(tolerance):
    a = tc.Assembly("one")
    block = a.part("block", tc.Box(10, 10, 10), fixed=True)
    scheme = [tc.Locator("Z", (5, 5, 0), "z", tolerance), *cases.translating(0)[1:]]
    a.locate(block, scheme)
    a.measure("height", block.point(0, 0, 10), along="z")
    return discretize(a)


@pytest.mark.parametrize("shape", SHAPES)
def test_deviations_follow_the_named_distribution(shape):
    d = draw(one_locator(tc.Tolerance(3, shape)), seed=3, start=0, stop=20_000)[:, 0]
    assert stats.kstest(d, SHAPES[shape].cdf).pvalue > 0.01
    if shape != "normal":
        assert np.abs(d).max() <= 1.5


def test_deviations_follow_any_frozen_distribution_of_scipy():
    skewed = stats.gamma(2, loc=-0.1, scale=0.05)
    d = draw(one_locator(skewed), seed=3, start=0, stop=20_000)[:, 0]
    assert stats.kstest(d, skewed.cdf).pvalue > 0.01


def test_locators_and_realizations_are_independent():
    d = draw(discretize(cases.ra1()), seed=1, start=0, stop=20_000)
    between = np.corrcoef(d.T) - np.eye(12)
    assert np.abs(between).max() < 4 / np.sqrt(len(d))
    lagged = [np.corrcoef(column[:-1], column[1:])[0, 1] for column in d.T]
    assert np.abs(lagged).max() < 4 / np.sqrt(len(d))


def test_a_locator_keeps_its_draws_when_others_come_or_go():
    alone, among = discretize(cases.one_dimensional(6)), discretize(cases.one_dimensional(0))
    k = alone.locators.labels.index("block.Z")
    assert (draw(alone, seed=1, start=0, stop=50)[:, k] == draw(among, seed=1, start=0, stop=50)[:, k]).all()
    assert (draw(among, seed=1, start=0, stop=50)[:, 0] == 0).all()
