"""Sampling plans: what they promise of the numbers, honest intervals from replicates, and runs that go on until they know."""

import numpy as np
import pytest
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, call, compiled
from tolcontact.vocabulary import LATIN_HYPERCUBE, MONTE_CARLO, SOBOL

STRATIFIED = [LATIN_HYPERCUBE, SOBOL]
LABELS = ["part.A1", "part.A2", "part.A3"]


@pytest.fixture(scope="module")
def ra1():
    return compiled(cases.ra1(), solver="daqp", method=PAPER)


@pytest.fixture(scope="module")
def plain(ra1):
    """What a run of independent realizations knows."""
    return tc.summarize(tc.run(ra1, samples=4096, seed=2, fields="none", surfaces=4))


@pytest.mark.slow
@pytest.mark.parametrize("name", STRATIFIED)
def test_a_run_by_a_plan_is_narrower_and_its_archive_says_so(name, ra1, plain, tmp_path):
    options = {"samples": 4096, "seed": 2, "fields": "none", "surfaces": 4}
    with tc.run(ra1, plan=name, out=tmp_path / "a.nc", **options) as results:
        assert results.attrs["sampler"] == name
        found = tc.summarize(results)
        kept = results["sample"].deviation.values
    widths = [
        np.diff(each.statistic_value.sel(statistic="mean", interval=["lower", "upper"]).values[0])[:, 0]
        for each in (plain, found)
    ]
    assert (widths[1] < [0.5 * widths[0][0], 0.95 * widths[0][1]]).all()
    assert np.array_equal(kept, ra1.draws.planned(name)(seed=2, start=0, stop=4096))
    with pytest.raises(tc.errors.ArchiveError, match="sampler"):
        tc.run(ra1, out=tmp_path / "a.nc", resume=True, **options)
    with tc.run(ra1, plan=name, out=tmp_path / "a.nc", resume=True, **options | {"samples": 5120}) as longer:
        assert np.array_equal(longer["sample"].deviation.values[:4096], kept) and longer.sizes["realization"] == 5120


@pytest.mark.slow
def test_a_run_goes_on_until_an_interval_is_narrow_enough(ra1, tmp_path):
    options = {"samples": 300, "fields": "none", "surfaces": 4, "keep": "measures"}
    results = tc.run(ra1, until="corner height: 6 sigma +-4 %", **options)
    estimate, lower, upper = tc.summarize(results).statistic_value.sel(state="corrected", statistic="6 sigma").values[0]
    assert (upper - lower) / 2 <= 0.04 * estimate
    assert 300 < results.sizes["realization"] < 20_000
    whole = tc.run(ra1, **options | {"samples": results.sizes["realization"]})
    assert np.array_equal(whole.measured, results.measured)  # the same realizations as without stages
    enough = tc.run(ra1, until="corner height: mean ±1", out=tmp_path / "a.nc", **options)
    assert enough.sizes["realization"] == 300
    of_plan = tc.run(ra1, until="corner height: 6 sigma +-4 %", plan=SOBOL, **options)
    assert of_plan.sizes["realization"] <= results.sizes["realization"]


@pytest.mark.slow
def test_what_cannot_be_reached_is_said(ra1, caplog):
    options = {"samples": 64, "fields": "none", "surfaces": 0, "keep": "measures"}
    results = tc.run(ra1, until="corner height: mean +-1e-9", **options)
    assert results.sizes["realization"] == 64 and "needs more than 100000000" in caplog.text
    free = cases.one_dimensional(0)
    unlimited = tc.run(compiled(free, method=PAPER), until="height: ppm +-20 %", **options)
    assert unlimited.sizes["realization"] == 64 and "limits" in caplog.text
    free.variable("rare", tc.Tolerance(distribution=stats.t(3)), drives={"block.Z": 1.0})
    heavy = compiled(free, method=PAPER)
    assert tc.run(heavy, until="height: kurtosis +-1 %", **options).sizes["realization"] < 200_000
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
def test_wrong_plans_and_targets_are_refused(options, said, ra1, tmp_path):
    with pytest.raises(tc.OptionError) as refused:
        tc.run(ra1, out=tmp_path / "a.nc", **options)
    assert said in str(refused.value) and not list(tmp_path.iterdir())


def test_a_measure_may_have_a_colon_in_its_name():
    a = cases.one_dimensional(0)
    a.measure("gap: left", a.parts[1].point(5, 5, 10), along="z")
    assert tc.run(compiled(a), samples=64, until="gap: left: mean +-10").sizes["realization"] == 64


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
