"""Runs side by side: from the same draws or not, on the command line and as a page."""

import json

import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, call, compiled, nightly
from tests.test_report import data_of
from tolcontact.report import write_comparison


def lifted(by, name="top", tolerance=None):
    """The stack, measured from another height; and a measure that others do not have."""
    a = cases.stack()
    upper, bottom = a.parts[-1], a.parts[0]
    a.measure("thickness", bottom.point(0, 0, 10 - by), to=upper.point(0, 0, 10), along="z", tolerance=1)
    a.measure(name, upper.point(0, 0, 10), along="x") if name != "top" else None
    return a


def run_of(model, **options):
    return tc.run(compiled(model, solver="daqp", method=PAPER), surfaces=0, fields="none", **options)


@pytest.fixture(scope="module")
def runs():
    made = {
        "one": (lifted(0.0), 300, 1),
        "higher": (lifted(0.25), 200, 1),
        "other": (lifted(0.0, "sideways"), 400, 2),
    }
    return {name: run_of(model, samples=n, seed=seed) for name, (model, n, seed) in made.items()}


@pytest.mark.slow
def test_a_known_shift_is_found_exactly_from_the_same_draws(runs):
    found = tc.compare_runs(runs)
    of = found.sel(run="higher", measure="thickness")
    assert str(of.draws.values) == "same" and str(found.draws.sel(run="other").values) == "other"
    shift = of.change.sel(change_of="shift of the mean", state="corrected").values
    assert shift == pytest.approx([0.25] * 3, abs=1e-4)  # parts turn, a little
    assert of.change.sel(change_of="ratio of 6 sigma", interval="estimate").values == pytest.approx(1, abs=1e-3)
    assert of.furthest.values == pytest.approx(0.25, abs=1e-3)
    back = tc.compare_runs({"higher": runs["higher"], "one": runs["one"]}).sel(run="one", measure="thickness")
    assert back.furthest.values == pytest.approx(of.furthest.values, abs=1e-9)  # all of it downward
    assert np.isnan(found.furthest.sel(run="other")).all() and np.isnan(found.change.sel(run="one")).all()


def test_values_are_those_of_the_summaries(runs):
    found = tc.compare_runs(runs)
    for name, run in runs.items():
        expected = tc.summarize(run).statistic_value.sel(measure="thickness", statistic="6 sigma")
        assert np.array_equal(found.value.sel(run=name, measure="thickness", statistic="6 sigma"), expected)
    assert found.realizations.values.tolist() == [300, 200, 400] and found.attrs["left_out"] == "sideways"


def test_independent_runs_have_wider_intervals_than_the_same_draws(runs):
    found = tc.compare_runs(runs).change.sel(measure="thickness", state="corrected", change_of="shift of the mean")
    assert found.sel(run="other", interval="lower") < 0 < found.sel(run="other", interval="upper")
    assert np.ptp(found.sel(run="other").values) > 100 * np.ptp(found.sel(run="higher").values)


def test_a_tolerance_that_differs_is_of_the_same_seed():
    wider, narrow = (run_of(model, samples=50, keep="measures") for model in (cases.stack(), lifted(0.0)))
    assert str(tc.compare_runs({"a": wider, "b": narrow}).draws.sel(run="b").values) == "same seed"


@pytest.mark.slow
def test_measures_are_in_the_order_of_the_first_run():
    def measured(*names):
        a = cases.stack()
        for name in names:
            a.measure(name, a.parts[-1].point(0, 0, 10), along="z")
        return run_of(a, samples=20, seed=1)

    found = tc.compare_runs({"one": measured("a", "b", "c"), "other": measured("c", "d", "a")})
    assert [name for name in found["measure"].values if name in "abcd"] == ["a", "c"]


@pytest.mark.slow
def test_the_command_compares_archives(archive, tmp_path):
    again = tmp_path / "again.nc"
    run_of(cases.stack(), samples=100, seed=4, out=again).close()
    done = call(tmp_path, "compare", archive, again, "--out", "both.nc", "--report", "both.html")
    assert done.returncode == 0, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 80 and "other draws" in done.stdout
    with xr.open_dataset(tmp_path / "both.nc") as read:
        assert read["run"].values.astype(str).tolist() == ["stack", "again"]
    assert [chart["name"] for chart in data_of((tmp_path / "both.html").read_text())["charts"]]
    said = json.loads(call(tmp_path, "compare", archive, again, "--json").stdout, parse_constant=pytest.fail)
    assert said["data_vars"]["realizations"]["data"] == [300, 100]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["{}"], "at least two runs"),
        (["{}", "{}"], "name each once"),
        (["{}", "model.py"], "neither one model nor archives"),
        (["{}", "other.nc"], "does not exist"),
        (["{}", "other.nc", "--samples", "20"], "--samples applies to a model"),
        (["model.py", "--report", "page.html"], "--report applies to archives"),
    ],
)
def test_what_cannot_be_compared_is_refused(options, said, archive, tmp_path):
    done = call(tmp_path, "compare", *(each.format(archive) for each in options))
    assert done.returncode == 2 and said in done.stderr and "Traceback" not in done.stderr
    assert not [*tmp_path.iterdir()]


def test_runs_without_a_measure_in_common_are_refused(runs):
    a = tc.Assembly("alone")
    block = a.part("block", tc.Box(10, 20, 10))
    a.locate(block, cases.translating(0.1))
    a.measure("height", block.point(5, 5, 10), along="z")
    with pytest.raises(tc.OptionError, match="share no measurement"):
        tc.compare_runs({"stack": runs["one"], "alone": tc.run(compiled(a), samples=10, surfaces=0)})


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, *nightly(1280)])
def test_the_page_of_a_comparison_is_read(runs, width, tmp_path, open_page):
    odd = {"<img src=x onerror=alert(1)>": runs["one"], **{name: runs[name] for name in ("higher", "other")}}
    write_comparison(odd, tc.compare_runs(odd), tmp_path / "runs.html")
    opened = open_page(tmp_path / "runs.html", width, drawn=".js-plotly-plot")
    assert opened.evaluate("document.documentElement.scrollWidth") <= width
    assert "<img src=x" in opened.locator("ul").first.inner_text()
    y = opened.evaluate("document.querySelectorAll('.chart')[1].data.map((trace) => trace.y.reduce((a, b) => a + b, 0))")
    assert y == pytest.approx([100, 100, 100])


def test_what_is_no_run_is_refused(runs, archive):
    with pytest.raises(tc.OptionError, match="at least two runs"):
        tc.compare_runs(archive)
    with pytest.raises(tc.OptionError, match='run "b" is a int'):
        tc.compare_runs({"a": runs["one"], "b": 3})


@pytest.mark.slow
def test_one_limit_is_enough_to_be_outside():
    def limited(**limits):
        a = cases.stack()
        a.measure("height", a.parts[-1].point(0, 0, 10), along="z", **limits)
        return run_of(a, samples=200, seed=1)

    wide, narrow, none = limited(limits=(None, 0.3)), limited(limits=(None, 0.0)), limited()
    change = tc.compare_runs({"wide": wide, "narrow": narrow}).change.sel(run="narrow", measure="height", state="raw")
    raw = wide["measured"].sel(measure="height", state="raw").values
    share = change.sel(change_of=change["change_of"].values[2], interval="estimate")
    assert float(share) == pytest.approx((raw > 0.0).mean() - (raw > 0.3).mean()) and float(share) > 0.1
    change = tc.compare_runs({"wide": wide, "none": none}).change.sel(run="none", measure="height", state="raw")
    assert np.isnan(float(change.sel(change_of=change["change_of"].values[2], interval="estimate")))
