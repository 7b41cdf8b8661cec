"""Linear shares of variance against closed forms, and what pages say of them."""

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tolcontact.report.contributor_shares import contributor_shares
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
