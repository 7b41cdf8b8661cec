"""Insides of `statistics` under the claims of `tests/test_linear_shares.py`."""

import numpy as np
import pytest
from scipy import stats

from tolcontact.statistics.variance_shares import joined_columns, linear_shares, required_realizations

SLOPES = np.array([3.0, 2.0, 1.0, 0.5, 0.0])
SIZES = np.array([1.0, 20.0, 0.3, 4.0, 5.0])  # standard deviations, in any units
BEND = 2.0  # of a square, which no line explains
ALONE = [np.array([k]) for k in range(5)]


def bent(n, generator):
    """A sum of five terms and the square of the first: x and y, with known shares."""
    z = generator.normal(size=(n, 5))
    return z * SIZES, z @ SLOPES + BEND * (z[:, 0] ** 2 - 1) / np.sqrt(2)


TRUTH = SLOPES**2 / (SLOPES @ SLOPES + BEND**2)


def test_shares_of_a_sum_are_exact_to_the_sample():
    x = np.random.default_rng(1).normal(size=(3000, 5)) * SIZES
    y = 7 + (x / SIZES) @ SLOPES
    (shares,) = linear_shares(x, y[:, None], ALONE)
    assert shares.r2[0] == pytest.approx(1, abs=1e-12)
    assert shares.shares[:, 0].sum() == pytest.approx(1, abs=1e-12)
    assert shares.shares[:, 0] == pytest.approx(SLOPES**2 / (SLOPES @ SLOPES), abs=0.03)


def test_intervals_cover_the_closed_form():
    generator, hits, trials = np.random.default_rng(2), np.zeros(5), 200
    for _ in range(trials):
        x, y = bent(600, generator)
        (shares,) = linear_shares(x, y[:, None], ALONE)
        hits += (shares.shares[:, 1] <= TRUTH) & (TRUTH <= shares.shares[:, 2])
        assert np.isnan(shares.r2[1:]).all()  # too few residuals
    assert (hits >= 0.9 * trials).all() and hits.mean() > 0.925 * trials


@pytest.mark.parametrize("tails", [stats.norm(), stats.lognorm(0.5), stats.t(5)], ids=lambda d: d.dist.name)
def test_shares_of_skewed_contributors_are_covered_and_r2_is_or_has_no_interval(tails):
    """A sum and a product of two contributors, which no line explains: its share is theirs, multiplied."""
    generator, hits, trials = np.random.default_rng(7), [], 200
    slopes, product = np.array([1.0, 0.5, 0.2]), 0.5
    truth = np.append(slopes**2, slopes @ slopes) / (slopes @ slopes + product**2)
    for _ in range(trials):
        z = (tails.rvs((1000, 3), random_state=generator) - tails.mean()) / tails.std()
        (shares,) = linear_shares(z, (z @ slopes + product * z[:, 0] * z[:, 1])[:, None], ALONE[:3])
        found = np.vstack([shares.shares, shares.r2])
        hits.append(np.where(np.isnan(found[:, 1]), np.nan, (found[:, 1] <= truth) & (truth <= found[:, 2])))
    *of_shares, of_r2 = np.transpose(hits)
    assert (np.nanmean(of_shares, axis=1) > 0.895).all() and np.isnan(of_shares).mean() < 0.05  # 92.5 % and 1.6 standard errors
    has_r2 = ~np.isnan(of_r2)
    assert of_r2[has_r2].mean() > 0.895 if tails.dist.name == "norm" else has_r2.mean() < 0.1


def test_a_contributor_that_seldom_deviates_has_no_interval_of_its_share():
    """In 1 % of 300 realizations; the other contributor is normal."""
    x = np.random.default_rng(4).normal(size=(300, 2))
    x[:, 0] = np.maximum(x[:, 0] - stats.norm.ppf(0.99), 0)
    (shares,) = linear_shares(x, (x @ np.array([10.0, 1.0]))[:, None], ALONE[:2])
    assert np.isnan(shares.shares[0, 1:]).all() and np.isfinite(shares.shares[1]).all() and np.isfinite(shares.shares[0, 0])


def test_what_is_explained_by_chance_is_not_counted():
    """Many contributors without an effect, few realizations: without the correction R2 would be 0.3."""
    generator, estimates = np.random.default_rng(3), []
    for _ in range(40):
        x, y = generator.normal(size=(400, 79)), generator.normal(size=400)
        (shares,) = linear_shares(x, y[:, None], [np.arange(79)])
        estimates.append(shares.shares[0, 0])
    assert abs(np.mean(estimates)) < 4 * np.std(estimates) / np.sqrt(40) and np.mean(estimates) < 0.03


def test_shares_depend_neither_on_units_nor_on_origins_nor_on_the_order():
    x, y = bent(1000, np.random.default_rng(4))
    (plain,) = linear_shares(x, y[:, None], ALONE)
    (other,) = linear_shares(1e6 * x[:, ::-1] + 1e7, -1e-6 * y[:, None] + 5, ALONE[::-1])
    assert other.shares == pytest.approx(plain.shares, abs=1e-6) and other.r2[0] == pytest.approx(plain.r2[0], abs=1e-6)


def test_groups_hold_what_is_drawn_together():
    """A column twice: neither has a share of its own, both together have all."""
    x, y = bent(1000, np.random.default_rng(5))
    doubled = np.column_stack([x, x[:, 0]])
    (plain,), (joined,) = (
        linear_shares(x, y[:, None], ALONE),
        linear_shares(doubled, y[:, None], [np.array([0, 5]), *ALONE[1:]]),
    )
    assert joined.shares[:, 0] == pytest.approx(plain.shares[:, 0], abs=3e-3)


def test_measures_that_do_not_vary_have_no_shares():
    x, y = bent(500, np.random.default_rng(6))
    bad = np.column_stack([np.full(500, 3.0), y, np.where(np.arange(500) == 7, np.nan, y)])
    constant, good, broken = linear_shares(x, bad, ALONE)
    assert constant is None and broken is None and good is not None
    with pytest.raises(ValueError, match="expected at least"):
        linear_shares(x[: required_realizations(5) - 1], bad[: required_realizations(5) - 1], ALONE)


def test_groups_whose_owners_are_named_alike_have_different_names():
    groups = joined_columns(["a", "b + c", "a + b", "c"], [[0, 1], [2, 3]], np.arange(4))  # both are "a + b + c"
    assert {name: columns.tolist() for name, columns in groups.items()} == {"a + b + c": [0, 1], "a + b + c (2)": [2, 3]}
