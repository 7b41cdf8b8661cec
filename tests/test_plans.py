"""Sampling plans: what they promise of the numbers, honest intervals from replicates, and runs that go on until they know."""

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad
from scipy.special import ndtri

import tolcontact as tc
from tests import cases
from tests.helpers import call, nightly
from tolcontact.statistics import intervals
from tolcontact.statistics.intervals import skewness
from tolcontact.statistics.sample import Sample
from tolcontact.variation.plans import Plan
from tolcontact.vocabulary import LATIN_HYPERCUBE, MONTE_CARLO, PLANS, REPLICATE, SOBOL

STRATIFIED = [LATIN_HYPERCUBE, SOBOL]
LABELS = ["part.A1", "part.A2", "part.A3"]


@pytest.mark.parametrize("name", STRATIFIED)
def test_each_replicate_fills_all_classes_of_each_contributor_once(name):
    numbers = Plan(name, LABELS).numbers(7, 0, 5 * REPLICATE)
    for label in LABELS:
        classes = np.floor(numbers(label).reshape(5, REPLICATE) * REPLICATE)
        assert (np.sort(classes, axis=1) == np.arange(REPLICATE)).all()
    firsts = [numbers(label).reshape(5, REPLICATE)[:, 0] for label in LABELS]
    assert len(np.unique(firsts)) == 15  # replicates and contributors differ


@pytest.mark.parametrize("name", PLANS)
def test_a_number_depends_on_seed_label_and_realization_alone(name):
    everything = Plan(name, LABELS).numbers(5, 0, 3000)
    for start, stop in ((0, 1), (7, 20), (255, 257), (256, 512), (1000, 2901)):
        some = Plan(name, LABELS[::-1]).numbers(5, start, stop)
        assert all((some(label) == everything(label)[start:stop]).all() for label in [*LABELS, "beside"])
    assert (Plan(name, LABELS).numbers(6, 0, 100)("part.A1") != everything("part.A1")[:100]).all()


@pytest.mark.parametrize("name", PLANS)
def test_single_numbers_are_uniform_and_contributors_independent(name):
    numbers = Plan(name, LABELS).numbers(3, 0, 40 * REPLICATE)
    x = np.column_stack([numbers(label) for label in LABELS])
    assert 0 < x.min() and x.max() < 1
    for column in x[::7].T:
        assert stats.kstest(column, "uniform").pvalue > 1e-3
    assert np.abs(np.corrcoef(x.T) - np.eye(3)).max() < 4 / np.sqrt(len(x))


def clipped(name, seed, count):
    """max(0, sum of three), whose standard deviation is 1."""
    numbers = Plan(name, LABELS).numbers(seed, 0, count)
    return np.maximum(0.0, sum(ndtri(numbers(label)) for label in LABELS) / np.sqrt(3))


MEAN, SECOND = 1 / np.sqrt(2 * np.pi), 0.5
SIGMA = np.sqrt(SECOND - MEAN**2)
CAPPED = [quad(lambda z, k=k: z**k * stats.norm.pdf(z), 0, 1)[0] + stats.norm.sf(1) for k in (1, 2, 3)]  # of min(1, max(0, z))
SKEW = (CAPPED[2] - 3 * CAPPED[0] * CAPPED[1] + 2 * CAPPED[0] ** 3) / (CAPPED[1] - CAPPED[0] ** 2) ** 1.5


@pytest.mark.parametrize("name", STRATIFIED)
@pytest.mark.parametrize("rest", [204, *nightly(60)])
def test_intervals_with_an_incomplete_replicate_cover(name, rest):
    """300 runs: errors over standard errors have Student's t distribution, whose spread is known to 15 % (99.9 %)."""
    truths = {"mean": MEAN, "share": stats.norm.sf(1), "6 sigma": 6 * SIGMA}
    errors = {word: [] for word in truths}
    for seed in range(300):
        # Of a single contributor complete replicates tell nearly all.
        values = np.maximum(0.0, ndtri(Plan(name, LABELS).numbers(seed, 0, 16 * REPLICATE + rest)(LABELS[0])))
        x = Sample(lambda values=values: [values[:3000], values[3000:]], REPLICATE)
        share = intervals.proportion(x.map(lambda piece: piece > 1))
        for word, own in zip(truths, (intervals.mean(x), share, intervals.standard_deviation(x, times=6)), strict=True):
            errors[word].append((own.value - truths[word]) / (own.upper - own.lower) * 2 * intervals.student(15))
    for word, of_runs in errors.items():
        assert np.sqrt(np.mean(np.square(of_runs))) == pytest.approx(np.sqrt(15 / 13), rel=0.15), word


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("name", [STRATIFIED[0], *nightly(*STRATIFIED[1:])])
def test_intervals_of_replicates_cover(name):
    """500 runs of 20 replicates; two standard errors of a coverage of 95 % are 2 %."""
    repeats, hits, widths = 500, dict.fromkeys(("mean", "6 sigma", "share", "95 %", "skewness"), 0), []
    truths = {"mean": MEAN, "6 sigma": 6 * SIGMA, "share": stats.norm.sf(1), "95 %": stats.norm.ppf(0.95), "skewness": SKEW}
    for seed in range(repeats):
        values = clipped(name, seed, 20 * REPLICATE)
        x = Sample(lambda values=values: [values[:3000], values[3000:]], REPLICATE)
        found = {
            "mean": intervals.mean(x),
            "6 sigma": intervals.standard_deviation(x, times=6),
            "share": intervals.proportion(x.map(lambda piece: piece > 1)),
            "95 %": intervals.percentiles(x, [95])[0],
            "skewness": skewness(x.map(lambda piece: np.minimum(piece, 1))),
        }
        for word, (estimate, lower, upper) in found.items():
            assert lower <= estimate <= upper
            hits[word] += lower <= truths[word] <= upper
        plain = intervals.mean(values)
        widths.append((found["mean"].upper - found["mean"].lower) / (plain.upper - plain.lower))
    assert all(0.93 * repeats <= count <= 0.98 * repeats for count in hits.values()), hits
    assert np.median(widths) < 0.6


def test_few_replicates_have_the_intervals_of_independent_realizations():
    x = clipped(SOBOL, 1, 15 * REPLICATE)
    assert intervals.mean(Sample(lambda: [x], REPLICATE)) == intervals.mean(x)
    assert intervals.mean(Sample(lambda: [x], 1)) == intervals.mean(x)
    nothing = Sample(lambda: [np.zeros(20 * REPLICATE, dtype=bool)], REPLICATE)
    assert intervals.proportion(nothing) == intervals.proportion_of(0, 20 * REPLICATE)


@pytest.mark.slow
@pytest.mark.parametrize("name", STRATIFIED)
def test_a_run_by_a_plan_is_narrower_and_its_archive_says_so(name, tmp_path):
    options = {"samples": 4096, "seed": 2, "solver": "daqp", "fields": "none", "surfaces": 4}
    plain = tc.summarize(tc.run(cases.ra1(), **options))
    with tc.run(cases.ra1(), plan=name, out=tmp_path / "a.nc", **options) as results:
        assert results.attrs["sampler"] == name
        found = tc.summarize(results)
        kept = results["sample"].deviation.values
    widths = [
        np.diff(each.statistic_value.sel(statistic="mean", interval=["lower", "upper"]).values[0])[:, 0]
        for each in (plain, found)
    ]
    assert (widths[1] < [0.5 * widths[0][0], 0.95 * widths[0][1]]).all()
    assert np.array_equal(kept, tc.build(cases.ra1()).draws.planned(name)(seed=2, start=0, stop=4096))
    with pytest.raises(tc.errors.ArchiveError, match="sampler"):
        tc.run(cases.ra1(), out=tmp_path / "a.nc", resume=True, **options)
    with tc.run(cases.ra1(), plan=name, out=tmp_path / "a.nc", resume=True, **options | {"samples": 8192}) as longer:
        assert np.array_equal(longer["sample"].deviation.values[:4096], kept) and longer.sizes["realization"] == 8192


@pytest.mark.slow
def test_a_run_goes_on_until_an_interval_is_narrow_enough(tmp_path):
    options = {"samples": 300, "solver": "daqp", "fields": "none", "surfaces": 4}
    results = tc.run(cases.ra1(), until="corner height: 6 sigma +-2 %", **options)
    estimate, lower, upper = tc.summarize(results).statistic_value.sel(state="corrected", statistic="6 sigma").values[0]
    assert (upper - lower) / 2 <= 0.02 * estimate
    assert 300 < results.sizes["realization"] < 20_000
    whole = tc.run(cases.ra1(), **options | {"samples": results.sizes["realization"]})
    assert np.array_equal(whole.measured, results.measured)  # the same realizations as without stages
    enough = tc.run(cases.ra1(), until="corner height: mean ±1", out=tmp_path / "a.nc", **options)
    assert enough.sizes["realization"] == 300
    of_plan = tc.run(cases.ra1(), until="corner height: 6 sigma +-2 %", plan=SOBOL, **options)
    assert of_plan.sizes["realization"] <= results.sizes["realization"]


@pytest.mark.slow
def test_what_cannot_be_reached_is_said(tmp_path, caplog):
    options = {"samples": 64, "solver": "daqp", "fields": "none", "surfaces": 0}
    results = tc.run(cases.ra1(), until="corner height: mean +-1e-9", **options)
    assert results.sizes["realization"] == 64 and "needs more than 100000000" in caplog.text
    free = cases.one_dimensional(0)
    assert tc.run(free, until="height: ppm +-20 %", **options).sizes["realization"] == 64 and "limits" in caplog.text
    free.variable("rare", tc.Tolerance(distribution=stats.t(3)), drives={"block.Z": 1.0})
    assert tc.run(free, until="height: kurtosis +-1 %", **options).sizes["realization"] < 200_000
    assert "more will not give one" in caplog.text  # heavy tails never have an interval


@pytest.mark.slow
@pytest.mark.parametrize("quiet", [(), ("--quiet",)])
def test_the_command_says_that_an_interval_is_not_reached(quiet, tmp_path):
    options = ("run", cases.MODELS / "ra1.py", "--samples", "64", "--surfaces", "0", "--out", "a.nc", *quiet)
    done = call(tmp_path, *options, "--until", "corner height: mean +-1e-9")
    assert done.returncode == 1 and "needs more than 100000000" in done.stderr and "archive: a.nc" in done.stdout
    with tc.open_archive(tmp_path / "a.nc") as results:
        assert results.sizes["realization"] == 64


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"plan": "halton"}, "plan is 'halton'"),
        ({"until": "corner height"}, "until is 'corner height'"),
        ({"until": "corner height: mean +-0"}, "until is"),
        ({"until": "corner height: width +-1 %"}, '"width"; expected one of: ppm, mean'),
        ({"until": "height: mean +-1 %"}, 'the measurement "height"; expected one of: corner height'),
        ({"until": 3}, "until is 3"),
    ],
)
def test_wrong_plans_and_targets_are_refused(options, said, tmp_path):
    with pytest.raises(tc.OptionError) as refused:
        tc.run(cases.ra1(), out=tmp_path / "a.nc", **options)
    assert said in str(refused.value) and not list(tmp_path.iterdir())


def test_a_measure_may_have_a_colon_in_its_name():
    a = cases.one_dimensional(0)
    a.measure("gap: left", a.parts[1].point(5, 5, 10), along="z")
    assert tc.run(a, samples=64, solver="daqp", until="gap: left: mean +-10").sizes["realization"] == 64


@pytest.mark.slow
def test_the_command_has_plans_and_targets(tmp_path):
    done = call(
        tmp_path, "run", cases.MODELS / "ra1.py", "--samples", "512", "--solver", "daqp", "--plan", "latin hypercube",
        "--until", "corner height: mean +-0.03", "--out", "a.nc",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with tc.open_archive(tmp_path / "a.nc") as results:
        assert results.attrs["sampler"] == LATIN_HYPERCUBE != MONTE_CARLO and results.sizes["realization"] > 512
    assert call(tmp_path, "run", cases.MODELS / "ra1.py", "--plan", "sobel").returncode == 2


def test_replicates_that_hit_alike_have_the_interval_of_independent_realizations():
    """Their spread is nothing, which is no reason to be sure: 4096 coins that come up in turns."""
    coins = np.tile([True, False], 2048)
    hits = Sample(lambda: [coins], replicate=256)
    assert hits.map(lambda piece: piece.astype(float)).widening == 0
    own = intervals.proportion(hits)
    expected = stats.binomtest(2048, 4096).proportion_ci(0.95, method="exact")
    assert (own.value, own.lower, own.upper) == pytest.approx((0.5, expected.low, expected.high), abs=1e-9)
