"""Intervals that cover, fields that equal the plain sums."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from tests import cases
from tolcontact import poses as pose, vocabulary as terms
from tolcontact.discretization import discretize
from tolcontact.statistics import DisplacementFields, intervals
from tolcontact.statistics.sample import Sample

SAMPLES, REPEATS = 1000, 1000


def cut(rng, size):
    """What contact does to a normal variable: max(0, g). And g."""
    g = rng.normal(size=size)
    return np.maximum(g, 0), g


TRUTH = {
    "mean": (lambda x, g: intervals.mean(x), 0.398942),
    "variance": (lambda x, g: intervals.variance(x), 0.340845),
    "6 sigma": (lambda x, g: intervals.standard_deviation(x, times=6), 6 * np.sqrt(0.340845)),
    "95 %": (lambda x, g: intervals.percentiles(x, [95])[0], stats.norm.ppf(0.95)),
    "share": (lambda x, g: intervals.proportion(x > 1), stats.norm.sf(1)),
    "variance ratio": (lambda x, g: intervals.variance_ratio(x, g), 0.340845),
    "shift": (lambda x, g: intervals.mean(x - g), 0.398942),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TRUTH)
def test_intervals_cover_the_truth_in_95_of_100(name):
    estimate, truth = TRUTH[name]
    rng = np.random.default_rng(11)
    found = np.array([estimate(*cut(rng, SAMPLES)) for _ in range(REPEATS)])
    covered = ((found[:, 1] <= truth) & (truth <= found[:, 2])).mean()
    # 3.3 standard errors of the coverage itself, and 1 % for the asymptotics at N = 1000.
    assert 0.95 - 0.033 < covered < 0.95 + 0.023 + 0.01
    assert (found[:, 1] <= found[:, 0]).all() and (found[:, 0] <= found[:, 2]).all()


@pytest.mark.parametrize("ties", [False, True])
def test_order_statistics_and_moments_are_those_of_the_values(ties):
    rng = np.random.default_rng(4)
    x, y = rng.standard_t(2, size=(2, 5003)) * np.exp(rng.normal(size=(2, 5003)) * 5)
    if ties:
        x = np.where(rng.random(5003) < 0.6, rng.choice([0.0, -1.0, 1e-300, 7.5], 5003), x)
    samples = [Sample.of(values) for values in (x, y)]
    ranks = [0, 1, 17, 2500, 2501, 5001, 5002]
    assert (samples[0].ordered(ranks) == np.sort(x)[ranks]).all()
    for percent in (0.135, 5, 50, 99.865):
        estimate, *bounds = intervals.percentiles(samples[0], [percent])[0]
        assert estimate == pytest.approx(np.percentile(x, percent), rel=1e-12)
        assert set(bounds) <= {-np.inf, np.inf, *x}
    assert intervals.variance_ratio(*samples) == pytest.approx(intervals.variance_ratio(x, y), rel=1e-12)
    assert intervals.mean(samples[0] - samples[1]) == pytest.approx(intervals.mean(x - y), rel=1e-12)
    assert np.isnan(Sample.of(np.append(x, np.nan)).ordered(ranks)).all()


def test_a_percentile_beyond_the_sample_has_no_bound():
    _, lower, upper = intervals.percentiles(np.random.default_rng(0).normal(size=1000), [0.135])[0]
    assert lower == -np.inf and np.isfinite(upper)


def test_equal_values_are_certain_only_if_the_measure_does_not_vary_without_contact():
    for value in (3.0, 17.3, 0.1):
        x = np.full(1000, value)
        for cause, spread in ((x, 0.0), (np.arange(1000.0), np.nan), (None, np.nan)):
            sample = Sample(lambda x=x: x, cause=None if cause is None else Sample.of(cause))
            assert intervals.mean(sample) == pytest.approx((value, value + spread, value + spread), nan_ok=True)
            assert intervals.variance(sample) == pytest.approx((0, spread, spread), nan_ok=True)
        assert np.isnan(intervals.variance_ratio(x, np.arange(1000.0))).all()


DISTRIBUTIONS = {
    "normal": stats.norm.ppf, "lognormal": stats.lognorm(1).ppf, "exponential": stats.expon.ppf, "uniform": stats.uniform.ppf,
    "t5": stats.t(5).ppf, "Pareto": stats.pareto(3.5).ppf, "two modes": lambda p: stats.norm.ppf(2 * p % 1) + 8 * (p > 0.5),
    **{f"stop {share}": lambda p, share=share: np.maximum(0, stats.norm.ppf(p) - stats.norm.ppf(share))
       for share in (0.5, 0.93, 0.99)},
    "two stops": lambda p: np.clip(stats.norm.ppf(p), -1, 1), "discrete": lambda p: np.floor(3 * p**4),
}  # fmt: skip
MOMENTS = {
    "mean": lambda x, y: intervals.mean(x), "variance": lambda x, y: intervals.variance(x),
    "skewness": lambda x, y: intervals.skewness(x), "kurtosis": lambda x, y: intervals.kurtosis(x),
    "shift": lambda x, y: intervals.shift(x, y, paired=False),
    "ratio": lambda x, y: intervals.variance_ratio(x, y, paired=False),
    "paired ratio": lambda x, y: intervals.variance_ratio(x, y, paired=True),
}  # fmt: skip


@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_no_interval_has_zero_length_and_solvers_agree_on_the_values_at_a_stop(name):
    for size in (20, 100, 300, 2000):
        for seed in range(5):
            rng = np.random.default_rng([seed, size])
            x, y = DISTRIBUTIONS[name](rng.random((2, size)))
            scatter = rng.normal(0, 1e-13, size)
            exact, scattered = ([Sample(lambda v=v: v, accuracy=1e-8) for v in (x + e, y + e)] for e in (0.0, scatter))
            for statistic, estimate in MOMENTS.items():
                found, other = estimate(*exact), estimate(*scattered)
                assert found.lower != found.upper, (statistic, size, seed)
                assert other == pytest.approx(found, rel=1e-6, abs=1e-9, nan_ok=True), (statistic, size, seed)


@pytest.mark.parametrize(("share", "size"), [(0.93, 300), (0.99, 300), (0.99, 1000), (0.998, 5000)])
def test_the_mean_at_a_stop_is_covered_or_has_no_interval(share, size):
    quantile = DISTRIBUTIONS["stop 0.5"]
    truth = quantile((np.arange(1_000_000) + 0.5) / 1e6, share).mean()
    found = [intervals.mean(quantile(np.random.default_rng([k, size]).random(size), share)) for k in range(200)]
    assert np.mean([estimate.lower > truth or estimate.upper < truth for estimate in found]) <= 0.075


@pytest.mark.slow
@pytest.mark.parametrize("size", [20, 30])
def test_intervals_of_spreads_cover_in_small_samples(size):
    rng = np.random.default_rng(2)
    covered = np.zeros(2)
    for _ in range(REPEATS):
        before, other = rng.normal(size=(2, size))
        found = intervals.variance(before), intervals.variance_ratio(0.6 * before + 0.8 * other, before)
        covered += [lower <= 1 <= upper for _, lower, upper in found]
        for percent in (0.135, 50):
            estimate, lower, upper = intervals.percentiles(before, [percent])[0]
            assert lower <= estimate <= upper
    has_interval = np.array([True, size >= intervals.MIN_RATIO])  # ratios of the smallest samples have none
    assert (covered[has_interval] / REPEATS > 0.92).all() and not covered[~has_interval].any()


def test_the_smallest_samples_have_no_interval_of_their_spread():
    x = np.random.default_rng(1).normal(size=19)
    for estimate, lower, upper in (intervals.variance(x), intervals.variance_ratio(x, x[::-1] ** 2)):
        assert estimate > 0 and np.isnan(lower) and np.isnan(upper)


def random_poses(nominal, count, rng):
    """Poses (n, state, part, 12), turned by some degrees."""
    turns = Rotation.from_rotvec(rng.normal(size=(count * 2 * len(nominal.parts), 3)) * 0.05)
    R = turns.as_matrix().reshape(count, 2, len(nominal.parts), 9)
    return np.concatenate([R, rng.normal(size=(count, 2, len(nominal.parts), 3))], axis=3)


def displacements(part, poses):
    """x, y, z and magnitude (realization, vertex, component) of the surface points of a part at poses (realization, 12)."""
    u = pose.apply(poses, part.vertices) - part.vertices
    return np.concatenate([u, np.linalg.norm(u, axis=2, keepdims=True)], axis=2)


@pytest.mark.slow
@pytest.mark.parametrize("magnitudes", [700, 450, 2])
def test_fields_equal_the_plain_sums_over_realizations(magnitudes):
    """However the realizations are cut into blocks, and far from the origin, too; the magnitude is of the first ones."""
    nominal = discretize(cases.stack(cases.Frame(shift=(1000.0, 0.0, 0.0))))
    poses = random_poses(nominal, 700, np.random.default_rng(2))
    fields = DisplacementFields(nominal, str(magnitudes))
    for first, last in ((0, 1), (1, 400), (400, 700)):
        fields.merge(fields.sums(poses[first:last], first, np.ones(last - first)))
    for index, (part, field) in enumerate(zip(nominal.parts, fields.fields(), strict=True)):
        assert field[terms.FIELD_REALIZATIONS] == 700 and field[terms.MAGNITUDE_REALIZATIONS] == magnitudes
        for state in (0, 1) if part.movers else (0,):
            u = displacements(part, poses[:, state, index])
            few = u[:magnitudes, :, 3]
            assert np.abs(field[terms.FIELD_MEAN][state, :, :3] - u[..., :3].mean(axis=0)).max() < 1e-9
            assert np.abs(field[terms.FIELD_SIX_SIGMA][state, :, :3] - 6 * u[..., :3].std(axis=0, ddof=1)).max() < 1e-9
            assert np.abs(field[terms.FIELD_MEAN][state, :, 3] - few.mean(axis=0)).max() < 1e-9
            assert np.abs(field[terms.FIELD_SIX_SIGMA][state, :, 3] - 6 * few.std(axis=0, ddof=1)).max() < 1e-9
            moments = (((few - few.mean(axis=0)) ** power).mean(axis=0)[::50] for power in (2, 4))
            expected = 6 * np.sqrt(intervals.variance_from_moments(magnitudes, *moments)[1:])
            found = field[terms.FIELD_INTERVAL][state, ::50]
            assert np.allclose(found, expected.T, rtol=1e-6, atol=1e-9, equal_nan=magnitudes == 2)


def test_sums_of_fields_go_on_from_where_they_were():
    nominal = discretize(cases.ra1())
    poses = random_poses(nominal, 60, np.random.default_rng(3))
    whole, half, rest = (DisplacementFields(nominal, "50") for _ in range(3))
    for fields, spans in ((whole, [(0, 20), (20, 40), (40, 60)]), (half, [(0, 20), (20, 40)])):
        for first, last in spans:
            fields.merge(fields.sums(poses[first:last], first, np.ones(last - first)))
    rest.resume_from(half.numbers)
    rest.merge(rest.sums(poses[40:], 40, np.ones(20)))
    assert all(np.array_equal(one, other) for one, other in zip(whole.numbers, rest.numbers, strict=True))


def test_without_magnitudes_components_stay_exact():
    nominal = discretize(cases.ra1())
    poses = random_poses(nominal, 30, np.random.default_rng(3))
    fields = DisplacementFields(nominal, "none")
    fields.merge(fields.sums(poses, 0, np.ones(30)))
    field = fields.fields()[1]
    u = displacements(nominal.parts[1], poses[:, 1, 1])
    assert np.abs(field[terms.FIELD_SIX_SIGMA][1, :, :3] - 6 * u[..., :3].std(axis=0, ddof=1)).max() < 1e-9
    assert np.isnan(field[terms.FIELD_SIX_SIGMA][1, :, 3]).all() and field[terms.MAGNITUDE_REALIZATIONS] == 0


def test_intervals_are_those_of_scipys_distributions():
    for n in (2, 7, 100, 5000):
        x = stats.norm.ppf((np.arange(n) + 0.5) / n)  # not skewed: Hall's interval of the mean is Student's
        assert intervals.mean(x)[1:] == pytest.approx(stats.t.interval(0.95, n - 1, x.mean(), x.std(ddof=1) / np.sqrt(n)))
        for p in (0.135, 5, 50, 95, 99.865):
            below, above = stats.binom.ppf([0.025, 0.975], n, p / 100).astype(int)
            ordered = np.sort(x)
            expected = (ordered[below - 1] if below >= 1 else -np.inf, ordered[above] if above < n else np.inf)
            assert intervals.percentiles(x, [p])[0][1:] == expected
        for k in {0, 1, n // 3, n}:
            hits = np.arange(n) < k
            bounds = stats.binomtest(k, n).proportion_ci(0.95, method="exact")
            assert intervals.proportion(hits) == pytest.approx((k / n, bounds.low, bounds.high))


@pytest.mark.parametrize("distribution", [stats.lognorm(1), stats.pareto(3.5)], ids=["lognormal", "Pareto"])
def test_an_interval_of_the_mean_of_20_skewed_values_covers_it(distribution):
    values = distribution.ppf(np.random.default_rng(3).random((1500, 20)))
    covered = [bool(lower <= distribution.mean() <= upper) for _, lower, upper in map(intervals.mean, values)]
    assert np.mean(covered) > 0.90  # Student's t: 0.87
