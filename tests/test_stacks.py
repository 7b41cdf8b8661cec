"""Stacks in one dimension: published figures, sensitivities, tables of links, and chains in assemblies."""

import io
import json
import math
import re

import numpy as np
import openpyxl
import pandas as pd
import pytest
import xarray as xr
from rich.console import Console
from scipy import stats

import tolcontact as tc
from tests.helpers import call, compiled, realizations
from tolcontact.report import analysis_text
from tolcontact.vocabulary import STACK_UP

DRAKE = {  # Drake, Dimensioning and Tolerancing Handbook (1999), ch. 9, in inches; A and J count negative
    "A": (0.375, "+0/-.031"), "B": (0.032, "±.002"), "C": (0.060, "±.003"), "D": (0.438, "+0/-.015"), "E": (0.120, "±.005"),
    "F": (1.5, "+.010/-.004"), "G": (0.120, "±.005"), "H": (0.438, "+0/-.015"), "I": (0.450, "±.007"),
    "J": (3.019, "+.012/-0"), "K": (0.300, "±.030"),
}  # fmt: skip


def motor():
    stack = tc.Stack("motor", units="in")
    for name, (nominal, tolerance) in DRAKE.items():
        stack.link(name, nominal, tolerance, sensitivity=-1 if name in "AJ" else 1)
    stack.gap("gap", limits=(0, None))
    return stack


def brackets():
    """Return two gaps that share the link "shared", with sensitivities other than 1 and -1."""
    stack = tc.Stack("brackets")
    stack.link("shared", 10, tc.Tolerance(0.3, "uniform"))
    stack.link("left", 4, "+0.1/-0.3")
    stack.link("right", 5, tc.Tolerance(0.4, cp=1.33, cpk=1.0))
    stack.gap("first", {"shared": 1, "left": -0.5})
    stack.gap("second", {"shared": 2, "right": -3})
    return stack


def stand():
    """Return a block that contact moves out of a table, with its corner measured, and the same by a chain of its locators."""
    model = tc.Assembly("stand")
    table = model.part("table", tc.Box(100, 50, 10), fixed=True)
    block = model.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    points = {"A1": (5, 5, 0), "A2": (45, 5, 0), "A3": (25, 20, 0)}
    sides = [tc.Locator("B1", (5, 0, 5), "y", 0), tc.Locator("B2", (45, 0, 5), "y", 0), tc.Locator("C1", (0, 12, 5), "x", 0)]
    model.locate(block, [*(tc.Locator(name, point, "z", 0.2) for name, point in points.items()), *sides])
    model.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
    model.measure("height", block.point(25, 12.5, 0), along="z")
    # The middle of the block is half between A1 and A2 along x, and half between them and A3 along y.
    model.measure("drawn", tc.Chain({"block.A1": 0.25, "block.A2": 0.25, "block.A3": 0.5}))
    return model


def test_published_figures_of_a_stack_of_eleven_dimensions():
    figures = tc.analyses.stack_up(motor(), samples=4000).sel(measure="gap")
    assert round(float(figures.drawn), 12) == 0.064 and round(float(figures.centred), 12) == 0.0615
    halves = dict(zip(figures.approach.values.tolist(), figures.half_width.values.tolist(), strict=True))
    assert math.isclose(halves["worst case"], 0.0955, abs_tol=1e-12)
    assert [round(halves[name], 4) for name in ("RSS", "MRSS")] == [0.0381, 0.0505]
    assert math.isclose(halves["1.5 RSS"], 1.5 * halves["RSS"])
    for end, sign in (("least", -1), ("largest", 1)):  # all are normal with 6 sigma in their zones, so RSS is exact
        value, lower, upper = figures.simulated.sel(state="raw", end=end).values
        assert lower <= 0.0615 + sign * halves["RSS"] <= upper and lower < value < upper
    assert int(figures.links) == 11


def test_a_dimension_is_shown_as_drawn_and_as_centred():
    rows = str(motor()).splitlines()
    assert "  dimension F [in]: 1.5 +0.01 -0.004, centred 1.503 ±0.007" in rows
    assert "  dimension J [in]: 3.019 +0.012 0, centred 3.025 ±0.006" in rows


def test_sensitivities_and_shared_links_have_the_moments_of_their_sums():
    results = realizations(compiled(brackets()), samples=20_000, seed=3)
    first, second = results.measured.sel(state="corrected").values.T
    left, right = 0.4 / 6, 0.4 / 1.33 / 6
    uniform, shift = 0.3 / math.sqrt(12), 0.2 * (1 - 1 / 1.33)
    spread = np.array([math.hypot(uniform, 0.5 * left), math.hypot(2 * uniform, 3 * right)])
    means, error = np.array([10 - 0.5 * (4 - 0.1), 20 - 3 * (5 + shift)]), 4 / math.sqrt(20_000)
    assert np.abs([first.mean(), second.mean()] - means).max() < error * spread.max()
    assert np.abs([first.std(), second.std()] / spread - 1).max() < error
    assert abs(np.corrcoef(first, second)[0, 1] - 2 * uniform**2 / spread.prod()) < error
    deviations = results["sample/deviation"].values
    assert np.abs(first - (10 - 0.5 * 4 + deviations @ [1, -0.5, 0])).max() < 1e-12
    assert np.abs(second - (20 - 3 * 5 + deviations @ [2, 0, -3])).max() < 1e-12


def test_linear_figures_take_limits_and_not_distributions():
    figures = tc.analyses.stack_up(brackets(), samples=3000)
    assert np.allclose(figures.drawn, [8, 5]) and np.allclose(figures.centred, [8.05, 5])
    worst, rss = figures.half_width.sel(approach=["worst case", "RSS"]).values.T
    assert np.allclose(worst, [0.15 + 0.1, 0.3 + 0.6]) and np.allclose(rss, [math.hypot(0.15, 0.1), math.hypot(0.3, 0.6)])
    factor = 1 + (worst / rss - 1) / (2 * (math.sqrt(2) - 1))
    assert np.allclose(figures.half_width.sel(approach="MRSS"), factor * rss)
    bounds = tc.analyses.worst_case(brackets(), samples=512).bound.sel(state="raw").values
    assert np.allclose(bounds, np.array([[8.05, 5]]).T + np.outer(worst, [-1, 1]))


def test_a_single_link_has_one_figure():
    stack = tc.Stack("single")
    stack.link("width", 20, "H7")
    stack.gap("gap")
    figures = tc.analyses.stack_up(stack, samples=3000)
    assert np.allclose(figures.half_width.values, 0.0105 * np.array([[1, 1, 1, 1.5]]))
    assert np.allclose(figures.centred, 20.0105)


def test_contributors_that_vary_jointly_count_as_one():
    model = tc.Assembly("hole")
    plate = model.part("plate", tc.Box(100, 60, 10), fixed=True)
    for letter, side in (("A", "-z"), ("B", "-y"), ("C", "-x")):
        plate.feature(letter, plate.face(side), datum=letter)
    top = plate.feature("top", plate.face("+z"), tc.Profile(0.2, "A"))
    model.measure("corner", top.point(100, 60, 10), along="z")
    figures, worst = tc.analyses.stack_up(model, samples=3000), tc.analyses.worst_case(model)
    assert figures.links.values.tolist() == [1]
    assert np.allclose(figures.half_width.values[0, :3], 0.1, rtol=1e-5)  # one zone: a corner reaches its ends
    assert np.allclose(worst.bound.sel(state="raw").values, [[-0.1, 0.1]], rtol=1e-5)


@pytest.mark.slow
def test_a_form_has_three_sigma_in_rss_and_no_worst_case():
    model = tc.Assembly("wavy")
    plate = model.part("plate", tc.Box(100, 60, 10), fixed=True)
    top = plate.feature("top", plate.face("+z"), tc.Flatness(0.2))
    model.measure("height", top.point(50, 30, 10), along="z")
    model.measure("size", tc.Chain({"width": 1}))
    model.variable("width", 0.6, nominal=3)
    figures = tc.analyses.stack_up(model, samples=6000)
    worst, rss, mrss, _ = figures.half_width.sel(measure="height").values
    spread = float(
        tc.run(compiled(model), samples=6000, fields="none", surfaces=0).measured.sel(measure="height", state="raw").std()
    )
    assert math.isnan(worst) and math.isnan(mrss) and abs(rss / (3 * spread) - 1) < 4 / math.sqrt(2 * 6000)
    assert figures.forms.values.tolist() == [1, 0]
    assert np.allclose(figures.half_width.sel(measure="size").values[:3], 0.3)


def test_a_chain_of_an_assembly_is_its_measure_until_contact_moves_parts():
    measured = tc.run(compiled(stand()), samples=400, seed=2).measured.transpose("measure", "state", "realization")
    (raw, corrected), (drawn, still) = measured.values
    assert np.abs(raw - drawn).max() < 3e-4  # of second order in the tilt, (0.26 / 15)^2
    assert np.array_equal(drawn, still) and (corrected > raw + 1e-3).mean() > 0.3
    text = _text(tc.analyses.stack_up(stand(), samples=3000), STACK_UP)
    assert "RSS, without contact agrees with the realizations" in text
    assert re.search(r"RSS, with contact is off by -0\.\d+ at the minimum", text)


@pytest.mark.parametrize("slope", [1e4, 1.0, 1e-6, 1e-10, 1e-14])
def test_linear_figures_do_not_depend_on_the_units_of_a_link(slope):
    """A pressure lengthens 1 m by +-0.05 mm, in addition to +-0.01 mm, whatever its units."""
    stack = tc.Stack("vessel")
    stack.link("length", 1000, 0.02)
    stack.link("pressure", 0, 0.1 / slope, sensitivity=slope)
    stack.gap("end")
    half_width = tc.analyses.stack_up(stack, samples=64).half_width.values[0]
    assert half_width[:2] == pytest.approx([0.06, math.hypot(0.01, 0.05)], rel=1e-5)
    linear = tc.analyses.contributions(stack, samples=64).linear.sel(group="pressure")
    assert float(linear.squeeze()) == pytest.approx(25 / 26, abs=1e-4)


def bent(slope):
    """Return the larger of two lengths C + slope T and C - slope T: C +-0.005 mm, and slope T +-0.03 mm."""
    stack = tc.Stack("bent")
    stack.link("C", 1, 0.01)
    stack.link("T", 0, 0.06 / slope)
    for name, sense in (("up", 1), ("down", -1)):
        stack.gap(name, {"C": 1, "T": sense * slope})
    stack.measure("larger", tc.Maximum("up", "down"))
    return stack


@pytest.mark.parametrize("slope", [1.0, 1e-3, 1e-7, 1e-10])
def test_a_kink_has_no_linear_figures_in_any_units(slope):
    """The larger length is C + slope |T|, whose slope by T is undefined as drawn, however small it is per unit of T."""
    stack = bent(slope)
    half_width = tc.analyses.stack_up(stack, samples=64).half_width
    assert np.isnan(half_width.sel(measure="larger")).all()
    assert float(half_width.sel(measure="up").isel(approach=0)) == pytest.approx(0.035)
    derivatives = tc.analyses.sensitivities(stack, samples=1000, seed=2)
    assert np.isnan(derivatives.nominal.sel(measure="larger")).all()
    # |T| is below the step of 0.01 sigma in 0.8 % of all realizations, and C has no kink.
    changing = derivatives.changing.sel(interval="estimate")
    assert 0.001 < float(changing.sel(contributor="T")) < 0.02 and float(changing.sel(contributor="C")) == 0


def test_few_realizations_do_not_judge_rss():
    assert "RSS is not judged: 2730 realizations bound the range" in _text(tc.analyses.stack_up(motor(), samples=500), STACK_UP)


def _text(dataset, record):
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(analysis_text(record, dataset))
    return " ".join(console.export_text().split())


def test_the_page_has_the_loop_the_figures_and_the_dimensions(tmp_path):
    done = call(tmp_path, "new", "play", "--stack")
    assert done.returncode == 0, done.stderr
    done = call(tmp_path, "run", "play.py", "--samples", "3000", "--out", "play.nc", "--report", "play.html")
    assert done.returncode == 0, done.stderr
    assert "gap [mm]: 0.4 as drawn, 0.48 centred" in done.stdout and "displacement magnitude" not in done.stdout
    page = (tmp_path / "play.html").read_text(encoding="utf-8")
    assert page.count('class="loop"') == 1 and "60 0 -0.16" in page and "59.92 ±0.08" in page
    assert 'id="scene"' not in page.split("<script")[0] and "MRSS, factor 1.4" in page and "sensitivity of gap" in page
    with tc.open_archive(tmp_path / "play.nc") as results:
        assert str(tc.io.model_of(results)) == str(tc.build(tmp_path / "play.py").nominal.assembly)
    tc.io.write_model(tmp_path / "play.py", tmp_path / "play.json")
    assert str(tc.build(tmp_path / "play.json").nominal.assembly) == str(tc.build(tmp_path / "play.py").nominal.assembly)


def test_a_resumed_stack_has_the_stack_up_of_all_its_realizations(tmp_path):
    tc.io.write_model(brackets(), tmp_path / "m.json")
    run = ("run", "m.json", "--out", "m.nc", "--quiet", "--report", "m.html", "--resume", "--samples")
    for samples in (10, 30, 30):
        done = call(tmp_path, *run, samples)
        assert done.returncode == 0 and f"measurements of brackets: {samples} realizations" in done.stdout, done.stderr
        stored = xr.load_dataset(tmp_path / "m.nc", group="statistics/stack_up")
        xr.testing.assert_identical(stored, tc.analyses.stack_up(tmp_path / "m.nc", samples=samples))
        assert f"<p>{samples} realizations. worst case, RSS" in (tmp_path / "m.html").read_text(encoding="utf-8")
    added = call(tmp_path, "stackup", "m.nc", "--into", "m.nc", "--samples", 40)
    assert added.returncode == 0 and call(tmp_path, *run, 35).stdout.count("of brackets: 40 realizations") == 1
    refused = call(tmp_path, "stackup", "m.nc", "--into", "m.nc", "--samples", 40)
    assert refused.returncode == 2 and "choose another archive, or more samples than its 40" in refused.stderr


def test_the_csv_of_a_stack_up_has_the_range_of_the_realizations(tmp_path):
    tc.io.write_model(brackets(), tmp_path / "m.json")
    options = ("stackup", "m.json", "--samples", 3000, "--quiet")
    table = pd.read_csv(io.StringIO(call(tmp_path, *options, "--csv").stdout), index_col=["measure", "approach"])
    data = json.loads(call(tmp_path, *options, "--json").stdout)["data_vars"]
    ends = table[[f"{end} {name}" for end in ("least", "largest") for name in ("estimate", "lower", "upper")]]
    states = [f"99.73 %, {word}" for word in ("without contact", "with contact")]
    simulated = ends.loc[[(measure, state) for measure in ("first", "second") for state in states]]
    assert np.allclose(simulated.values.reshape(2, 2, 2, 3), data["simulated"]["data"])
    assert np.allclose(table["half_width"].dropna().values.reshape(2, 4), data["half_width"]["data"])


def test_a_stack_has_all_analyses():
    stack = brackets()
    stack.gap("limited", {"shared": 1, "left": 1}, limits=(13.6, 14.2))
    program = compiled(stack)
    shares = tc.analyses.contributions(program, samples=512).linear.sel(measure="first").values
    variances = np.array([0.3**2 / 12, 0.25 * (0.4 / 6) ** 2])
    assert np.allclose(sorted(shares)[-2:], sorted(variances / variances.sum()), atol=0.02)
    slopes = tc.analyses.sensitivities(program, samples=20).nominal.sel(measure="second").values
    assert np.allclose(slopes, [2, 0, -3])
    assert float(tc.analyses.tails(program).probability.sel(event="limited outside limits", interval="estimate")) > 0
    assert tc.analyses.allocate(program, require=["limited: ppm 100000"], samples=1024).met.values.all()


TABLES = {
    "commas": "name,nominal,tolerance,sensitivity\nA,0.375,+0/-.031,-1\nB,0.032,±.002,\n",
    "semicolons": "sep=;\r\nName;Nominal;Upper;Lower;Sensitivity\r\nA;0,375;0;-0,031;-1\r\nB;0,032;0,002;-0,002;1\r\n;;;;\r\n",
    "line breaks": 'name,nominal,tolerance,sensitivity,description\nA,0.375,+0/-.031,-1,"base,\nof steel"\nB,0.032,±.002,1,\n',
    "tabs": "\ufeffname\tnominal\ttolerance\tgap play\tdescription\nA\t0.375\t+0/-.031\t-1\tbase\nB\t0.032\t±.002\t1\twasher\n",
}


@pytest.mark.parametrize("kind", [*TABLES, "workbook"])
def test_links_from_a_table_are_those_of_a_script(kind, tmp_path):
    path = tmp_path / ("links.xlsx" if kind == "workbook" else "links.csv")
    if kind == "workbook":
        book = openpyxl.Workbook()
        for row in (
            ["Name", "Nominal", "Upper", "Lower", "Sensitivity"],
            ["A", 0.375, 0, -0.031, -1],
            ["B", 0.032, 0.002, -0.002, 1],
        ):
            book.active.append(row)
        book.save(path)
    else:
        path.write_text(TABLES[kind], encoding="utf-8")
    stack, scripted = tc.Stack("play"), tc.Stack("play")
    links = stack.read(path)
    if kind != "tabs":
        stack.gap("play")
    scripted.link("A", 0.375, "+0/-.031", sensitivity=-1)
    scripted.link("B", 0.032, "±.002")
    scripted.gap("play")
    assert [link.name for link in links] == ["A", "B"] and str(stack) == str(scripted)
    assert dict(stack.measures[0].of.sensitivities) == {"A": -1, "B": 1}


def test_measured_links_of_a_table_have_the_intervals_of_their_parts(tmp_path):
    rows = (
        "name;nominal;tolerance;sensitivity;mean;sd;parts", "groove;52,1;±0,04;;;;", "washer;12;;-1;11,9820;0,0075;30",
        "rod;40;;-1;40,01;0,0080;",
    )  # fmt: skip
    (tmp_path / "links.csv").write_text("\n".join(rows), encoding="utf-8")
    stack, scripted = tc.Stack("play"), tc.Stack("play")
    stack.read(tmp_path / "links.csv")
    scripted.link("groove", 52.1, "±0.04")
    scripted.link("washer", 12, tc.Tolerance(distribution=stats.norm(-0.018, 0.0075), parts=30), sensitivity=-1)
    scripted.link("rod", 40, tc.Tolerance(distribution=stats.norm(0.01, 0.008)), sensitivity=-1)
    assert str(scripted.variables[-1]) == "variable rod [mm]: mean 0.01, standard deviation 0.008 mm"
    summaries = []
    for model in (stack, scripted):
        model.gap("play")
        summaries.append(tc.summarize(tc.run(compiled(model), samples=2000, seed=1)).statistic_value.values)
    assert np.allclose(*summaries, rtol=1e-9, atol=1e-12, equal_nan=True)
    assert compiled(stack).draws.in_words == compiled(scripted).draws.in_words != []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it is empty; expected a heading with the names of columns, and rows below it; its columns are some of: name, "),
        ("name,nominal,tolerance\n", "it has no rows below its heading"),
        ("name,nominl,tolerance\nA,1,0.1\n", 'it has a column "nominl"; the nearest name is "nominal"'),
        ("name,nominal\nA,1\n", 'expected either a column "tolerance", or two, "upper" and "lower"'),
        ("name,nominal,upper\nA,1,0.1\n", 'expected either a column "tolerance", or two, "upper" and "lower"'),
        ("name,nominal,nominal,tolerance\nA,1,1,0.1\n", 'it has 2 columns "nominal"; expected one'),
        ("name,nominal,tolerance\nA,one,0.1\n", 'row 2: nominal is "one"; expected a number'),
        ("name,nominal,tolerance\nA,1,0.1\n\nB,#DIV/0!,0.1\n", 'row 4: nominal is "#DIV/0!"; expected a number'),
        ("name;nominal;tolerance\nA;1,250;0.1\n", "its comma may separate decimals or thousands: write 1.250 or 1250"),
        ("name;nominal;tolerance\nA;1.250;0.1\nB;2,5;1\n", "its point may separate decimals or thousands: write 1,250 or 1250"),
        ("name,nominal,tolerance\nA,1_0,0.1\n", 'row 2: nominal is "1_0"; expected a number'),
        ("name,nominal,tolerance\nA,1e16,0.1\n", 'row 2: nominal is "1e16"; expected a number up to 1e+15'),
        ("name,nominal,tolerance\nA,1,±1e16\n", 'row 2: tolerance is "±1e16"; expected numbers up to 1e+15'),
        ("name,nominal,tolerance\n,1,0.1\n", "row 2: name is empty"),
        ("name,nominal,tolerance\nA,1\n", "row 2: tolerance is empty"),
        ("name,nominal,tolerance\nA,1,+0.1\n", 'row 2: tolerance is "+0.1"; it states one of two limits'),
        ("name,nominal,upper,lower\nA,1,-0.1,0.1\n", "row 2: the lower limit +0.1 is above the upper one -0.1"),
        ("name,nominal,tolerance\nA,1,5,0.1\n", "row 2: it has 4 cells for 3 columns; write decimals with a point"),
        ("name,nominal,tolerance,distribution\nA,1,0.1,gauss\n", 'row 2: unknown distribution "gauss"'),
        ("name,nominal,tolerance,cp,cpk\nA,1,0.1,,1\n", "row 2: cpk is 1.0 with cp None; expected cp"),
        ("name,nominal,tolerance,sensitivity\nA,1,0.1,minus\n", 'row 2: sensitivity is "minus"; expected a number'),
        ("name,nominal,tolerance,mean,sd\nA,1,0.1,1.01,0.02\n", "row 2: it has mean and sd, and tolerance, which they replace"),
        ("name,nominal,mean,sd,parts\nA,1,1.01,0.02,30.5\n", "row 2: parts is 30.5; expected a whole number, 5 or more"),
        ("name,nominal,mean,sd\nA,1,1.01,0\n", "row 2: sd is 0; expected a standard deviation above 0"),
        ("name,nominal,tolerance,parts\nA,1,0.1,30\n", "row 2: mean and sd are empty"),
        ("name,nominal,mean,sd\nA,1,,\n", "row 2: mean and sd are empty"),
    ],
)  # fmt: skip
def test_a_fault_of_a_table_is_one_message(text, message, tmp_path):
    (tmp_path / "links.csv").write_text(text, encoding="utf-8")
    with pytest.raises(tc.ModelError) as refused:
        tc.Stack("play").read(tmp_path / "links.csv")
    assert len(refused.value.faults) == 1 and message in refused.value.faults[0], refused.value.faults


def test_all_faults_of_a_table_are_listed_at_once(tmp_path):
    (tmp_path / "links.csv").write_text("name,nominal,tolerance\nA,x,0.1\nB,1,±\nC,1,0.1\n", encoding="utf-8")
    with pytest.raises(tc.ModelError) as refused:
        tc.Stack("play").read(tmp_path / "links.csv")
    assert [re.findall(r"row \d", fault) for fault in refused.value.faults] == [["row 2"], ["row 3"]]


@pytest.mark.parametrize(
    ("chain", "message"),
    [
        (tc.Chain({}), "the chain has no links"),
        (tc.Chain({"width": "1"}), "sensitivities has 'width': '1'"),
        (tc.Chain({"width": 1}, nominal=math.nan), "nominal is nan; expected a number"),
        (tc.Chain({"widht": 1}), 'its link "widht" is no contributor; the nearest name is "width"'),
    ],
)
def test_a_chain_with_a_fault_is_refused(chain, message):
    stack = tc.Stack("play")
    stack.link("width", 10, 0.1)
    stack.measure("gap", chain)
    assert [fault for fault in tc.check(stack) if message in fault] and len(tc.check(stack)) == 1


def test_a_tolerance_of_a_link_that_is_none_is_said_with_its_name():
    with pytest.raises(ValueError, match=r'link "width": tolerance is \'\+0.1\'; it states one of two limits'):
        tc.Stack("play").link("width", 10, "+0.1")


def test_a_stack_of_uniform_links_has_the_density_of_irwin_and_hall():
    stack = tc.Stack("discs")
    for k in range(3):
        stack.link(f"disc {k}", 5, tc.Tolerance(1.0, "uniform"))
    stack.gap("height", limits=(None, 15.9))
    results = realizations(compiled(stack), samples=40_000, seed=5)
    share = float((results.measured.sel(state="corrected") > 15.9).mean())
    expected = (3 - 2.4) ** 3 / 6  # of the sum of three uniform numbers beyond 2.4
    assert stats.binomtest(round(share * 40_000), 40_000, expected).pvalue > 1e-4
