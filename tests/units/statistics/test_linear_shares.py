"""Insides of `statistics` under the claims of `tests/test_linear_shares.py`."""

import numpy as np
import pytest

from tolcontact.statistics.linear_shares import linear_shares, required_realizations

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
    generator, hits, trials = np.random.default_rng(2), np.zeros(6), 200
    for _ in range(trials):
        x, y = bent(600, generator)
        (shares,) = linear_shares(x, y[:, None], ALONE)
        found = np.vstack([shares.shares, shares.r2])
        truth = np.append(TRUTH, TRUTH.sum())
        hits += (found[:, 1] <= truth) & (truth <= found[:, 2])
    assert (hits >= 0.88 * trials).all() and hits.mean() > 0.91 * trials


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
    assert other.shares == pytest.approx(plain.shares, abs=1e-6) and other.r2 == pytest.approx(plain.r2, abs=1e-6)


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
