"""Insides of `statistics` under the claims of `tests/test_capability.py`."""

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq

import tolcontact as tc
from tests import cases
from tests.helpers import nightly
from tests.test_capability import PERCENTS, truth
from tests.test_guide import GUIDE
from tolcontact.limits import Limits
from tolcontact.simulation import simulate_blocks
from tolcontact.statistics import capability, intervals
from tolcontact.statistics.sample import Sample

CHAPTER = " ".join((GUIDE / "statistics.md").read_text(encoding="utf-8").split())
DISTRIBUTIONS = {
    "normal": (stats.norm(0, 1), -3.0, 4.0),
    "skewed": (stats.gamma(4), 0.5, 14.0),
    "off-centre": (stats.weibull_min(1.5), -1.0, 3.0),
    "one side": (stats.gamma(4), -np.inf, 11.0),
    "bounded": (stats.beta(2, 5), 0.02, np.inf),
}


def estimates(values, lower, upper):
    x, limits = Sample.of(values), Limits(lower, upper)
    sides = limits._replace(upper=np.inf), limits._replace(lower=-np.inf), limits
    shares = [capability.share_outside(x, side) for side in sides]
    found = [*shares, *capability.by_percentiles(x, limits), *capability.as_normal(x, limits)]
    return dict(zip(("below", "above", "outside", "Pp", "Ppk", "Pp as normal", "Ppk as normal"), found, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["normal", *nightly(*(name for name in DISTRIBUTIONS if name != "normal"))])
def test_intervals_cover_the_truth_in_95_of_100(name):
    distribution, lower, upper = DISTRIBUTIONS[name]
    expected, rng = truth(distribution, lower, upper), np.random.default_rng(8)
    covered = dict.fromkeys(expected, 0)
    for _ in range(500):
        for word, (value, low, high) in estimates(distribution.ppf(rng.random(8000)), lower, upper).items():
            assert np.isnan(value) == np.isnan(expected[word]) and (np.isnan(value) or low <= value <= high)
            covered[word] += bool(low <= expected[word] <= high)
    for word, count in covered.items():
        # 3.3 standard errors of the coverage itself around 94 to 96 of 100; exact intervals of rare events cover more.
        exact = word in ("below", "above", "outside")
        assert np.isnan(expected[word]) or 0.94 - 0.035 < count / 500 < (1.001 if exact else 0.96 + 0.03), (word, count)


@pytest.mark.nightly
@pytest.mark.slow
def test_intervals_cover_the_truth_where_contact_cuts_a_distribution_off():
    """A block over a table, which holds it up: max(z, 0) of a normal z, with half of the realizations at 0."""
    a = tc.Assembly("cut")
    table, block = a.part("table", tc.Box(40, 40, 10), fixed=True), a.part("block", tc.Box(10, 20, 10), at=(10, 10, 10))
    a.locate(block, cases.translating(tc.Tolerance(distribution=stats.norm(0, 0.1))))
    a.contact("under", moving=block.face("-z"), reference=table.face("+z"), points=8)
    a.measure("height", block.point(5, 10, 0), along="z", limits=(None, 0.25))
    program, upper, z = tc.build(a, solver="daqp"), 0.25, stats.norm(0, 0.1)
    expected = {"outside": z.sf(upper), "Ppk": upper / z.ppf(0.99865)}
    mean = 0.1 / np.sqrt(2 * np.pi)
    expected["Ppk as normal"] = (upper - mean) / (3 * np.sqrt(0.1**2 / 2 - mean**2))
    covered = dict.fromkeys(expected, 0)
    for seed in range(500):
        (block_of,) = simulate_blocks(program, samples=2500, seed=seed, block=2500)
        found = estimates(block_of.measured[:, 1, 0], -np.inf, upper)
        for word, value in expected.items():
            covered[word] += bool(found[word].lower <= value <= found[word].upper)
    assert all(0.94 - 0.035 < count / 500 < 0.96 + 0.03 for count in covered.values()), covered


def test_places_of_percentiles_are_those_of_order_statistics():
    """The bounds of one percentile alone are those that the binomial distribution says."""
    n = 5000
    for numbers, p in zip(capability.values_below(n), PERCENTS, strict=True):
        low, high = np.quantile(numbers, [0.025, 0.975])
        assert stats.binom.ppf([0.025, 0.975], n, p) == pytest.approx([low, high], abs=1.0)


def test_a_small_sample_bounds_no_tail():
    """At most one value lies outside: any index is possible. With two outside, the index is bounded from above."""
    for upper in (30.0, 18.0):
        for index in capability.by_percentiles(Sample.of(np.arange(20.0)), Limits(-5.0, upper)):
            assert np.isfinite(index.value) and np.isnan(index[1:]).all()
    for index in capability.by_percentiles(Sample.of(np.arange(20.0)), Limits(-5.0, 17.0)):
        assert index.lower == 0 < index.value < index.upper


def test_equal_values_of_a_measured_population_are_no_stop_and_those_that_contact_keeps_are():
    """Ties at the limit: of parts drawn with replacement, whose largest is as large as allowed; of parts that rest there."""
    rng = np.random.default_rng(6)
    population = rng.normal(size=50)
    limits = Limits(-4.0, population.max(), 1e-8)
    drawn = rng.choice(population, 4000)
    assert capability.without_stops(Sample.of(drawn), limits) == limits
    raw = drawn + np.where(drawn == population.max(), 0.1, 0.0)
    x = Sample(lambda: np.minimum(raw, population.max()), accuracy=1e-8, cause=Sample.of(raw))
    assert capability.without_stops(x, limits) == limits._replace(upper=np.inf)


def test_the_realizations_that_a_positive_bound_of_ppk_needs_are_those_of_the_guide():
    """In 2.5 % of samples of n no value is beyond the outer percentile of the one side, or of one of the two."""
    p = PERCENTS[0]
    one = np.log(0.025) / np.log(1 - p)
    two = brentq(lambda n: 2 * (1 - p) ** n - (1 - 2 * p) ** n - 0.025, 2000, 5000)
    assert (capability.MIN_TAIL, capability.MIN_TAILS) == (round(one, -1), round(two, -1))
    stated = f"Fewer than about {round(one, -1):.0f} realizations with one limit, or {round(two, -1):.0f} with two limits"
    assert stated in CHAPTER
    for limits, needed in ((Limits(-np.inf, 4.0), one), (Limits(-4.0, 4.0), two)):
        for factor, is_bounded in ((0.98, False), (1.02, True)):
            normal = stats.norm.ppf((np.arange(int(factor * needed)) + 0.5) / int(factor * needed))
            pp, ppk = capability.by_percentiles(Sample.of(normal), limits)
            for index in (pp, ppk):
                assert np.isnan(index.value) or (index.lower > 0 if is_bounded else np.isnan(index[1:]).all())


def test_two_values_equally_often_have_an_index_without_spread():
    """Their variance does not depend on which of them a realization has, so an interval is as wide as rounding."""
    index, _ = capability.as_normal(Sample.of(np.tile([0.1, 0.3], 5000)), Limits(-0.1, 0.9))
    assert index.value == pytest.approx(1.0 / 0.6, rel=1e-3) and index.upper - index.lower < 1e-6


def test_a_limit_at_which_values_stop_has_no_capability_of_its_own():
    """Contact keeps max(0, z); a mass of more than 0.135 % at the limit would be an index of exactly 1 whatever else varies."""
    z = 0.1 * np.random.default_rng(3).standard_normal(20_000)
    for noise in (0.0, 1e-13, 1e-9):
        x = np.where(z > 0, z, noise * np.sin(1e6 * z))
        limits = Limits(0.0, 0.4, accuracy=1e-8)
        one, alone = (capability.by_percentiles(Sample.of(x), of) for of in (limits, Limits(-np.inf, 0.4, 1e-8)))
        assert one[1] == pytest.approx(alone[1]) and np.isnan(one[0].value)
        assert capability.share_outside(Sample.of(x), limits).value == (z > 0.4).mean()
        assert capability.without_stops(Sample.of(x), limits) == Limits(-np.inf, 0.4, 1e-8)
    assert capability.without_stops(Sample.of(np.append(x, -1e-6)), limits) == limits


def test_constant_measures_have_shares_and_no_capability():
    found = estimates(np.full(100, 0.3), 0.0, 0.2)
    assert found["above"].value == 1 and np.isnan(found["Ppk"].value) and np.isnan(found["Ppk as normal"].value)


@pytest.mark.parametrize(
    ("distribution", "skew", "kurt"), [(stats.norm(), 0, 3), (stats.expon(), 2, 9), (stats.uniform(), 0, 1.8)]
)
def test_skewness_and_kurtosis_are_those_of_the_distribution(distribution, skew, kurt):
    x = Sample.of(distribution.ppf(np.random.default_rng(2).random(400_000)))
    for (value, low, high), expected in ((intervals.skewness(x), skew), (intervals.kurtosis(x), kurt)):
        assert abs(value - expected) < (0.05 if kurt < 4 else 0.3)
        # Heavy tails are told by few realizations; then there is no interval.
        assert (low < expected < high and high - low < 0.1) if kurt < 3.5 else np.isnan(low) and np.isnan(high)


def test_what_is_just_on_a_limit_is_inside():
    x = Sample.of(np.array([-1.0, 0.0, 1.0, 1.0]))
    for limit, below, above in ((-1.0, 0, 0.75), (0.0, 0.25, 0.5), (1.0, 0.5, 0), (-1 + 1e-9, 0, 0.75), (1 - 1e-9, 0.5, 0)):
        limits = Limits(limit, limit, accuracy=1e-8)
        assert [capability.share_outside(x, side).value for side in limits.sides] == [below, above]


def test_a_lower_limit_is_the_upper_one_of_the_mirrored_values():
    """Of a skewed distribution: mean and spread vary together, so that the interval depends on the side."""
    values = stats.gamma(4).ppf(np.random.default_rng(5).random(4000))
    lower, upper = estimates(values, 0.5, np.inf), estimates(-values, -np.inf, -0.5)
    np.testing.assert_allclose(lower["Ppk as normal"], upper["Ppk as normal"], rtol=1e-9)
    other = estimates(values, -np.inf, 2 * values.mean() - 0.5)  # as far from the mean, on the other side
    index, of_other = (side["Ppk as normal"] for side in (lower, other))
    assert index.value == pytest.approx(of_other.value) and np.diff(index[1:]) != pytest.approx(np.diff(of_other[1:]), rel=0.05)


@pytest.mark.slow
def test_intervals_of_skewed_measures_in_few_realizations_cover_as_often_as_the_guide_says():
    rng = np.random.default_rng(5)
    for name, distribution, stated in (("exponential", stats.expon(), 96), ("lognormal", stats.lognorm(0.5), 95)):
        assert f"{stated} % ({name})" in CHAPTER
        samples = distribution.ppf(rng.random((4000, 30)))
        found = [intervals.root(intervals.variance(Sample.of(sample)), times=6) for sample in samples]
        covered = np.mean([low <= 6 * distribution.std() <= high for _, low, high in found])
        assert covered == pytest.approx(stated / 100, abs=0.02)  # four standard errors


def test_ppk_at_a_stop_does_not_depend_on_the_share_that_rests_there():
    """0.2 % rest at the lower limit, hardly more than the percentile of 0.135 %: Ppk is that of the upper limit in all."""
    stop, rng = stats.norm.ppf(0.002), np.random.default_rng(4)
    for _ in range(12):
        x = Sample.of(np.maximum(stop, rng.standard_normal(5000)))
        value, lower, upper = capability.by_percentiles(x, Limits(stop, 9.0, 1e-8))[1]
        assert lower <= value <= upper and 2.5 < value < 3.5
