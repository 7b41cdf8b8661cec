"""Measures that are not numbers for some deviations: no answer counts these realizations as good or bad without a word."""

import io
import json
import re

import casadi
import numpy as np
import pytest
from rich.console import Console
from scipy import stats

import tolcontact as tc
from tests.helpers import call, nightly
from tolcontact.report import analysis_text
from tolcontact.vocabulary import SWEEP

SCRIPT = """import tolcontact as tc, casadi as ca
def assembly():
    m = tc.Assembly("x"); p = m.part("p", tc.Box(50, 25, 10))
    m.locate(p, tc.three_two_one(p.face("-z"), p.face("-y"), p.face("-x")), tolerance=0.6)
    def lg(poses): x = poses.position(p.point(0, 0, 0))[0]; return ca.if_else(x < 0, ca.log(x), 0.0)
    m.measure("lg", lg, limits=(None, 0)); return m
"""


def block_with(function, **limits):
    """A block on locators of which that in x varies by 0.6 (sigma 0.1), and a measure that is a function of its x [mm]."""
    a = tc.Assembly("block")
    block = a.part("block", tc.Box(50, 25, 10))
    below = [tc.Locator(f"Z{k}", (x, y, 0), "z", 0) for k, (x, y) in enumerate([(5, 5), (45, 5), (25, 20)])]
    beside = [tc.Locator(f"Y{k}", (x, 0, 5), "y", 0) for k, x in enumerate((5, 45))]
    a.locate(block, [*below, *beside, tc.Locator("X", (0, 12, 5), "x", 0.6)])
    place = block.point(0, 12, 5)
    a.measure("place", place, along="x", limits=(-0.45, None))
    a.measure("function", lambda poses: function(poses.position(place)[0]), **limits)
    return a


@pytest.mark.parametrize(
    "function",
    [casadi.log, lambda x: casadi.sqrt(0.2 + x), lambda x: casadi.sqrt(x - 1)],
    ids=["nominally", "at an end", "all"],
)
def test_what_is_no_number_for_some_combinations_has_no_worst_case(function):
    with pytest.raises(tc.OptionError, match='"block": measurement "function": not a finite number for some combinations'):
        tc.analyses.worst_case(block_with(function), samples=16)


def test_a_measure_of_any_combination_has_its_worst_case():
    worst = tc.analyses.worst_case(block_with(lambda x: casadi.sqrt(0.4 + x)), samples=16).worst.sel(
        measure="function", state="raw"
    )
    assert worst.values == pytest.approx(np.sqrt([0.1, 0.7]), rel=1e-6)


def test_the_probability_of_what_is_no_number_is_not_stated():
    """As the statistics of a run, where a value that is not a number is neither inside nor outside."""
    model = block_with(casadi.log, limits=(None, -2.0))
    found = tc.analyses.tails(model, seed=2)
    assert np.isnan(found.probability.sel(event="function outside limits").values).all()
    exact = stats.norm.sf(4.5)
    lower, upper = found.probability.sel(event="place outside limits").values[1:]
    assert lower <= exact <= upper
    statistics = tc.summarize(tc.run(model, samples=200, surfaces=0, fields="none")).statistic_value
    assert np.isnan(statistics.sel(measure="function").values).all()


def test_a_measure_that_is_a_number_but_for_negligible_deviations_has_its_probability():
    """Inflated deviations lead to where it is none: 9 standard deviations from nominal."""
    found = tc.analyses.tails(block_with(lambda x: casadi.sqrt(0.9 + x), limits=(None, np.sqrt(1.35))), seed=2)
    estimate, lower, upper = found.probability.sel(event="function outside limits").values
    assert lower <= stats.norm.sf(4.5) <= upper < 2 * estimate


def test_the_table_of_tails_says_what_is_not_defined(tmp_path):
    script = tmp_path / "block.py"
    script.write_text(SCRIPT)
    done = call(tmp_path, "tails", script)
    assert done.returncode == 0 and "lg outside limits    -" in done.stdout, done.stderr
    assert "lg outside limits: the measurement is not a number in some realizations" in done.stdout
    assert "values stop at a limit" not in done.stdout  # at 0, where they are numbers
    assert "Traceback" not in (failed := call(tmp_path, "worst", script)).stderr and failed.returncode == 2
    assert failed.stderr.startswith('error: "x": measurement "lg": not a finite number')


def test_an_infinite_measure_is_no_number_and_numpy_says_nothing_of_it(tmp_path, recwarn):
    model = block_with(lambda x: 1 / casadi.fmax(x, 0.0), limits=(None, 1e6))
    with tc.run(model, samples=50, surfaces=0, fields="none") as results:
        tc.report.write_page(results, tc.summarize(results), tmp_path / "page.html")
    assert np.isnan(tc.analyses.sensitivities(model, samples=4)["nominal"].sel(measure="function")).all()
    tc.analyses.contributions(model, samples=16)
    tc.analyses.stack_up(model, samples=16)
    assert not [str(warning.message) for warning in recwarn if issubclass(warning.category, RuntimeWarning)]


def test_sensitivities_leave_out_what_is_no_number_and_say_of_how_many_realizations(tmp_path):
    model = block_with(lambda x: 1 / casadi.if_else(x < 0, 0.0, 1 + x))
    model.measure("never", lambda poses: 1 / (0 * poses.position(model.parts[0].point(0, 0, 0))[0]))
    tc.run(model, samples=50, surfaces=0, fields="none", out=tmp_path / "block.nc").close()
    found = tc.analyses.sensitivities(model, samples=100, into=tmp_path / "block.nc").sel(contributor="block.X")
    count = int(found["not_a_number"].sel(measure="function"))
    assert 30 < count < 70 and found["not_a_number"].sel(measure=["place", "never"]).values.tolist() == [0, 100]
    of = found.sel(measure="function", state="corrected")
    assert np.isnan(of["nominal"]) and float(of["sensitivity"][0]) == pytest.approx(-0.8, abs=0.1) and of["spread"] < 0.2
    assert np.isnan(found.sel(measure="never")["sensitivity"]).all()
    text = re.sub(r"\s+", " ", call(tmp_path, "sensitivities", "block.nc", "--samples", "100").stdout)
    assert f"function: not a number in {count} % of the realizations, or at a step from there; they are left out" in text
    assert "never: not a number in 100 % of the realizations" in text and "nan" not in text


@pytest.mark.parametrize("value", ["casadi.sqrt(-1 - x**2)", *nightly("1 / (0 * x)")])
def test_a_measure_that_is_never_a_number_says_so_once(value, tmp_path):
    (script := tmp_path / "block.py").write_text(f"""import casadi, tolcontact as tc
def assembly():
    a = tc.Assembly("block")
    block = a.part("block", tc.Box(50, 25, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0.1)
    wall = a.part("wall", tc.Box(50, 25, 10), at=(0, 0, 10), fixed=True)
    a.contact("seat", moving=block.face("+z"), reference=wall.face("-z"))
    def function(poses):
        x = poses.rotation(block)[2, 0]
        return {value}
    a.measure("u", function, limits=(-1, 1))
    return a
""")
    done = call(tmp_path, "run", script, "--samples", "200", "--solver", "daqp", "--quiet")
    assert "u: not a number in 100 % of the realizations, so it has no verdict" in done.stdout
    assert done.returncode == 1 and "warning" not in done.stderr
    table = call(tmp_path, "stackup", script, "--samples", "200", "--solver", "daqp").stdout
    assert "u [mm]: not a number as drawn" in table and "No linear figures: it is not a number in" in table
    assert "nan" not in table and "kink" not in table


@pytest.mark.parametrize(("limits", "code", "word"), [("limits=(-1, 1)", 1, "verdict"), ("units='mm'", 0, "statistics")])
def test_a_measure_that_is_not_a_number_says_so(tmp_path, limits, code, word):
    (script := tmp_path / "block.py").write_text(f"""import casadi, tolcontact as tc
def assembly():
    a = tc.Assembly("block")
    block = a.part("block", tc.Box(50, 25, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0.1)
    a.measure("u", lambda p: casadi.sqrt(p.rotation(block)[2, 0]), {limits})
    return a
""")
    done = call(tmp_path, "run", script, "--samples", "200", "--solver", "daqp", "--out", "block.nc")
    line = next(line for line in done.stdout.splitlines() if line.startswith("u: "))
    assert line.startswith("u: not a number in ") and line.endswith(f" of the realizations, so it has no {word}")
    assert 40 < float(line.split()[5]) < 60 and done.returncode == code and "invalid value" not in done.stderr
    assert done.stdout.endswith("archive: block.nc\n")
    said = {option: call(tmp_path, "summary", "block.nc", *option) for option in [(), ("--all",), ("--limits",), ("--csv",)]}
    assert [(answer.returncode, answer.stderr) for answer in said.values()] == [(code, "")] * 4
    done = call(tmp_path, "summary", "block.nc", "--json")
    figures = json.loads(done.stdout, parse_constant=pytest.fail)["data_vars"]["statistic_value"]["data"]
    assert figures[0][1][0] == [None] * 3 and done.returncode == code


def test_a_combination_with_an_undefined_value_is_undefined():
    """The least and the largest of x and of the root of 0.05 + x, which is undefined below -0.05."""
    model = block_with(lambda x: casadi.sqrt(0.05 + x))
    for name, combination in (("largest", tc.Maximum), ("least", tc.Minimum)):
        model.measure(name, combination("place", "function"), limits=(-1, 1))
    with tc.run(model, samples=100, surfaces=0, fields="none") as results:
        place, function, largest, least = results["measured"].sel(state="corrected").transpose("measure", ...).values
    is_undefined = np.isnan(function)
    assert 10 < is_undefined.sum() < 50 and np.isfinite(place).all()
    np.testing.assert_array_equal(largest, np.where(is_undefined, np.nan, np.maximum(place, function)))
    np.testing.assert_array_equal(least, np.where(is_undefined, np.nan, np.minimum(place, function)))


def test_a_swept_measure_that_is_no_number_has_no_share_outside():
    """Half of the realizations are undefined at the first position, and none at the second."""
    swept = tc.analyses.sweep(
        lambda shift: block_with(lambda x: casadi.sqrt(x + shift), limits=(None, 2)), {"shift": [0, 1]}, samples=100
    )
    function = swept.sel(measure="function")
    assert np.isnan(function["outside"]).all() and np.isfinite(swept["outside"].sel(measure="place")).all()
    assert function["extreme_share"].isel(end=0, position=0).values == pytest.approx([1, 1])
    console = Console(file=(stream := io.StringIO()), width=120)
    console.print(analysis_text(SWEEP, swept))
    text = stream.getvalue()
    assert re.search(r"function: not a number in [3-6]\d % of the realizations at some position, so it has no envelope", text)
    assert "nan" not in text


def test_a_reason_is_given_why_what_is_no_number_has_no_figure(tmp_path):
    (script := tmp_path / "block.py").write_text(SCRIPT.replace("ca.if_else(x < 0, ca.log(x), 0.0)", "ca.sqrt(x + 0.25)"))
    table = call(tmp_path, "stackup", script, "--samples", "3000").stdout
    assert "RSS is not judged: the measurement is not a number in some realizations." in table
    done = call(tmp_path, "run", script, "--samples", "1000", "--until", "lg: mean +-0.001", "--quiet")
    assert "mean of lg has no value (it is not a number in some realizations); no more" in done.stderr
