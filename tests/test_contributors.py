"""What varies together: shared causes, correlation, measured populations. Draws depend on seed, label and number alone."""

import io

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from rich.console import Console
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.cases import toleranced
from tests.helpers import compiled
from tolcontact.discretization import discretize
from tolcontact.report import summary_text
from tolcontact.testing import assert_gaps_recompute, assert_same_run
from tolcontact.variation import Draws

SAMPLES = 20_000


def draws_of(model, start=0, stop=SAMPLES):
    nominal = discretize(model)
    found = Draws(nominal)(seed=4, start=start, stop=stop)
    return {label: found[:, k] for k, label in enumerate(nominal.contributors)}


def correlated(*labels, matrix):
    a = cases.ra1()
    a.correlate(labels, matrix)
    return a


def test_correlated_draws_have_their_correlation_and_their_own_distributions():
    labels = ("top.A1", "top.A2", "base.C1")
    matrix = np.array([[1, 0.8, -0.3], [0.8, 1, 0.1], [-0.3, 0.1, 1]])
    drawn = draws_of(correlated(*labels, matrix=matrix))
    found = np.corrcoef([drawn[label] for label in labels])
    low, high = (np.tanh(np.arctanh(matrix - np.eye(3)) + sign * 3.9 / np.sqrt(SAMPLES - 3)) for sign in (-1, 1))
    off = ~np.eye(3, dtype=bool)
    assert (low[off] < found[off]).all() and (found[off] < high[off]).all()
    alone = draws_of(cases.ra1())
    assert (drawn["top.A1"] == pytest.approx(alone["top.A1"], abs=1e-12)) and (drawn["top.B1"] == alone["top.B1"]).all()
    for label in labels:
        assert stats.kstest(drawn[label], "norm", (0, alone[label].std())).pvalue > 1e-3


def test_marginals_of_other_shapes_stay():
    a = tc.Assembly("uniform")
    top = a.part("top", tc.Box(50, 25, 10))
    a.locate(top, tc.three_two_one(top.face("-z"), top.face("-y"), top.face("-x")), tolerance=tc.Tolerance(0.6, "uniform"))
    a.measure("x", top.point(0, 0, 0), along="x")
    a.correlate(["top.A1", "top.A2"], -0.7)
    drawn = draws_of(a)
    for label in ("top.A1", "top.A2"):
        assert stats.kstest(drawn[label], "uniform", (-0.3, 0.6)).pvalue > 1e-3
    rank = stats.spearmanr(drawn["top.A1"], drawn["top.A2"]).statistic
    assert rank == pytest.approx(6 / np.pi * np.arcsin(-0.7 / 2), abs=0.02)


def two_supports(distribution, coefficient, kind):
    a = tc.Assembly("two")
    top = a.part("top", tc.Box(50, 25, 10))
    faces = [top.face(side) for side in ("-z", "-y", "-x")]
    a.locate(top, tc.three_two_one(*faces), tolerance=tc.Tolerance(distribution=distribution))
    a.measure("x", top.point(0, 0, 0), along="x")
    a.correlate(["top.A1", "top.A2"], coefficient, kind=kind)
    return a


SIGMA = 0.8  # of the logarithm
LOGNORMAL = stats.lognorm(SIGMA, loc=-0.1, scale=0.1)
PEARSON = (np.exp(0.7 * SIGMA**2) - 1) / (np.exp(SIGMA**2) - 1)  # of lognormal deviations with normal scores of 0.7


@pytest.mark.parametrize(
    ("distribution", "kind", "stated"),
    [
        (LOGNORMAL, "copula", 0.7),
        (LOGNORMAL, "pearson", PEARSON),
        (LOGNORMAL, "rank", 6 / np.pi * np.arcsin(0.35)),
        (stats.uniform(-0.1, 0.2), "pearson", 6 / np.pi * np.arcsin(0.35)),
        (stats.norm(0, 0.1), "pearson", 0.7),
    ],
)
def test_coefficients_of_each_kind_have_the_copula_of_their_closed_form(distribution, kind, stated):
    found, expected = (draws_of(two_supports(distribution, *choice)) for choice in ((stated, kind), (0.7, "copula")))
    assert found["top.A2"] == pytest.approx(expected["top.A2"], abs=1e-6)
    if distribution is LOGNORMAL and kind == "copula":
        assert PEARSON == pytest.approx(0.630, abs=5e-4)
        program = compiled(two_supports(distribution, stated, kind), solver="daqp")
        (line,) = program.draws.in_words
        assert line == 'correlation of "top.A1" and "top.A2": copula 0.700, Pearson 0.630, rank 0.683'
        console = Console(file=io.StringIO(), width=200)
        console.print(summary_text(tc.summarize(tc.run(program, samples=20, surfaces=0))))
        assert line in console.file.getvalue()


def test_coefficients_that_cannot_exist_are_refused():
    least = (np.exp(-(SIGMA**2)) - 1) / (np.exp(SIGMA**2) - 1)
    (fault,) = tc.check(two_supports(LOGNORMAL, -0.6, "pearson"))
    assert f"have Pearson coefficients from {least:.3f} to 1.000 alone, by their distributions, and not -0.6" in fault
    (fault,) = tc.check(two_supports(LOGNORMAL, 0.6, "kendall"))
    assert "kind is 'kendall'; expected one of: copula, pearson, rank" in fault
    a = two_supports(LOGNORMAL, 0.1, "copula").replaced(correlations=[])
    a.correlate(["top.A1", "top.A2", "top.A3"], [[1, -0.49, -0.49], [-0.49, 1, -0.49], [-0.49, -0.49, 1]], kind="rank")
    (fault,) = tc.check(a)
    assert "no Gaussian copula has these rank coefficients together" in fault


def with_everything():
    a = toleranced.block_with("top", tc.Profile(0.3, "A"))
    block = a.parts[0]
    block.feature("far", block.face("+x"), tc.Position(0.2, "A|B|C"))
    a.variable("warmth", tc.Tolerance(20, "uniform"), drives={"block.top.offset": 0.002, "block.far.offset": -0.001}, units="K")
    a.correlate(["block.far.tilt y", "block.far.tilt z"], 0.5)
    rows = np.random.default_rng(1).normal(size=(7, 1)) * [0.01]
    a.population(pd.DataFrame(rows, columns=["measured"]), {"block.far.offset": "measured"})
    return a


@pytest.mark.slow
def test_a_shared_cause_drives_all_that_it_names():
    drawn, alone = draws_of(with_everything()), draws_of(toleranced.block_with("top", tc.Profile(0.3, "A")))
    assert drawn["block.top.offset"] == pytest.approx(alone["block.top.offset"] + 0.002 * drawn["warmth"], abs=1e-15)
    assert np.ptp(drawn["warmth"]) == pytest.approx(20, rel=1e-3)
    results = tc.run(compiled(with_everything()), samples=300)
    sample = results["sample"].to_dataset()
    assert sample["contributor_units"].sel(contributor="warmth") == "K"
    assert sample["source"].sel(contributor=["block.top.offset", "warmth"]).values.tolist() == ["feature", "variable"]
    assert_gaps_recompute(results)
    assert_same_run(results, tc.run(compiled(tc.io.model_of(results)), samples=300))


@pytest.mark.parametrize("kind", ["frame", "dataset", "csv", "mapping"])
def test_rows_of_a_population_stay_together(kind, tmp_path):
    rng = np.random.default_rng(0)
    first = rng.normal(size=50) * 0.1
    table = {"one": first, "two": -2 * first + 0.01}
    sources = {
        "frame": pd.DataFrame(table),
        "dataset": xr.Dataset({name: ("part", values) for name, values in table.items()}),
        "mapping": table,
        "csv": tmp_path / "Maße, gemessen.csv",
    }
    pd.DataFrame(table).to_csv(sources["csv"], index=False)
    a = cases.ra1()
    a.population(sources[kind], {"top.A1": "one", "top.A2": "two"})
    drawn = draws_of(a)
    assert drawn["top.A2"] == pytest.approx(-2 * drawn["top.A1"] + 0.01, abs=1e-12)
    assert set(np.round(drawn["top.A1"], 12)) == set(np.round(first, 12))
    counts = np.unique(drawn["top.A1"], return_counts=True)[1]
    assert stats.chisquare(counts).pvalue > 1e-3


def test_contributors_that_follow_from_each_other_have_a_common_cause():
    model = tc.Assembly("opposite")
    block = model.part("block", tc.Box(10, 20, 10))
    model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0)
    model.variable("play", 0.6, drives={"block.A1": 1.0, "block.A2": -1.0})
    model.measure("height", block.point(0, 0, 0), along="z")
    drawn = draws_of(model)
    assert np.array_equal(drawn["block.A1"], -drawn["block.A2"]) and np.std(drawn["block.A1"]) == pytest.approx(0.1, rel=0.05)


@pytest.mark.slow
def test_a_population_is_in_the_archive():
    first = np.random.default_rng(0).normal(size=50) * 0.1
    a = cases.ra1()
    a.population({"one": first, "two": -2 * first + 0.01}, {"top.A1": "one", "top.A2": "two"})
    results = tc.run(compiled(a), samples=100, surfaces=0)
    assert_same_run(results, tc.run(compiled(tc.io.model_of(results)), samples=100, surfaces=0))


@pytest.mark.parametrize(
    ("declare", "said"),
    [
        (lambda a: a.correlate(["top.A1", "top.A2"], 1.5), "not positive definite"),
        (lambda a: a.correlate(["top.A1", "top.A2"], -1.0), "common cause by variable(name, tolerance, drives="),
        (lambda a: a.correlate(["top.A1", "top.A2"], [[1, 0.5], [0.4, 1]]), "not symmetric"),
        (lambda a: a.correlate(["top.A1", "top.A2"], [[4, 0.5], [0.5, 4]]), "correlation coefficients, not covariances"),
        (lambda a: a.correlate(["top.A1"], [[1]]), "two or more different contributors"),
        (lambda a: a.correlate(["top.A1", "top.X9"], 0.5), 'unknown contributor "top.X9"; contributors are, for example: top.'),
        (lambda a: [a.correlate(["top.A1", f"top.A{k}"], 0.5) for k in (2, 3)], "is drawn by correlation"),
        (lambda a: a.variable("heat", 1, drives={"top.Q": 1}), 'unknown contributor "top.Q"'),
        (lambda a: a.variable("heat", 1, drives={}), "it drives nothing"),
        (lambda a: a.variable("top.A1", 1, drives={"top.A2": 1}), 'contributor "top.A1" is declared 2 times'),
        (lambda a: a.population({"top.A1": [0.1]}), "it has 1 row(s); a population needs two or more"),
        (lambda a: a.population({"top.A1": [0.1, "wide", 0.2]}), "row 2 of the column for top.A1 is no number up to 1e+15"),
        (lambda a: a.population({"top.A1": [0.1, True]}), "row 2 of the column for top.A1 is no number up to 1e+15"),
        (lambda a: a.population({"top.A1": [False, True]}), "row 1 of the column for top.A1 is no number up to 1e+15"),
        (lambda a: a.population({"top.A1": [0.1, np.nan]}), "row 2 of the column for top.A1 is no number up to 1e+15"),
    ],
)
def test_wrong_causes_have_one_message(declare, said):
    a = cases.ra1()
    declare(a)
    (fault,) = tc.check(a)
    assert said in fault and ("test_contributors.py" in fault or "declared 2 times" in fault)


def test_unknown_owners_of_contributors_are_named_beside_other_faults():
    a = cases.ra1()
    a.measure("reversed", a.parts[0].point(0, 0, 0), along="z", limits=(1, 0))
    a.variable("heat", 1, drives={"tpo.A1": 1, "top.not made yet": 1, 3: 1})
    a.correlate(["top.A1", "tpo.A1"], 0.5)
    a.population({"top.A1": [0.1, 0.2], "top.A9": [0.1, 0.2]})
    a.part("empty", tc.Box(1, 1, -1), fixed=True)
    unknown = [fault for fault in tc.check(a) if "unknown contributor" in fault]
    assert len(unknown) == 2 and all(
        'unknown contributor "tpo.A1"; contributors are, for example: top.' in one for one in unknown
    )
    assert not any("is drawn by" in fault for fault in tc.check(a))


def test_tables_that_cannot_be_read_are_named(tmp_path):
    a = cases.ra1()
    with pytest.raises(ValueError, match=r'population "none.csv" cannot be read as CSV'):
        a.population(tmp_path / "none.csv")
    texts = {
        "one\n0,1\n0,2\n": "line 2 has 2 entries, and the heading 1; .*line 3 has 2 entries",
        "one,two\n1,2\n1\n": "line 3 has 1 entries, and the heading 2",
        "one\n0.1\n#DIV/0!\n": r'line 3, column "one" is "#DIV/0!"; expected a number; mend the table, or leave out the rows',
        "one\n0.1\n \n0.2\n": 'line 3, column "one" is empty',
        "one,two\nmm,mm\n1,2\n": 'line 2, column "one" is "mm"',
        "one\n0.1 mm\n": 'line 2, column "one" is "0.1 mm"',
        "one\ttwo\n1,250\t1\n": 'line 2, column "one" is "1,250"; .*; its comma may separate decimals or thousands',
        "one;two\n1,5;1\n1.250;1\n": 'line 3, column "one" is "1.250"; .*its point may .* thousands: write 1,250 or 1250',
        "one\n1_000\n0x10\nnan\ninf\n1\n": 'line 2, .*"1_000".* line 3, .*"0x10".*line 4, .*"nan".*; and 1 more;',
        "one,one\n1,2\n": 'columns 1 and 2 are both named "one"; rename one of them',
        "one [um]\n1\n": r'column "one \[um\]" is in um; give units="um"',
        "one (\N{MICRO SIGN}m)\n1\n": 'is in um; give units="um"',
        "one [deg]\n1\n": r'column "one \[deg\]" is in deg; expected numbers in mm, as top.A1 is, and \[mm\] or nothing',
        "one (furlong)\n1\n": "is in furlong; expected numbers in mm",
        "two\n1\n": "has no column 'one'; its columns are: two",
        "one\n1e16\n": 'line 2, column "one" is "1e16"; expected a number up to 1e\\+15',
        "one\n\u0661\n": 'line 2, column "one" is "\u0661"; expected a number',
        'one\n"1\n2\n': "line 2 has a quotation mark that is not closed",
        "": "it is empty; expected a heading",
        "PK\3\4": "it is a workbook; save it as CSV, or read it with pandas.read_excel",
    }
    for text, message in texts.items():
        (tmp_path / "p.csv").write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match=f'^population "p.csv".*{message}'):
            a.population(tmp_path / "p.csv", {"top.A1": "one"})
    for text in ("one;two\n1.250;0\n", "one;two\n1.25;0,5\n"):  # points alone, and one that separates no thousands
        (tmp_path / "p.csv").write_text(text, encoding="utf-8")
        assert a.population(tmp_path / "p.csv", {"top.A1": "one"}).values.tolist() == [[1.25]]
    (tmp_path / "p.csv").write_text("shaft [in],heat [K]\n0.001,2\n-0.001,1\n", encoding="utf-8")
    motor = tc.Stack("motor", units="in")
    motor.link("shaft", 1.5, 0.002)
    motor.variable("heat", 4, units="K", nominal=20)
    assert motor.population(tmp_path / "p.csv").values.tolist() == [[0.001, 2], [-0.001, 1]]
    with pytest.raises(ValueError, match=r'column "shaft \[in\]" is in in; give units="in"'):
        motor.population(tmp_path / "p.csv", units="um")
    in_mm = motor.population({"shaft": [0.0254, -0.0254], "heat": [2, 1]}, units="mm", gauge=0.0127)
    assert in_mm.values == pytest.approx(np.array([[0.001, 2], [-0.001, 1]]))
    assert in_mm.gauge == pytest.approx((0.0005, 0.0127))
    with pytest.raises(ValueError, match="a population is a int that is no table"):
        a.population(3)
    with pytest.raises(ValueError, match=r"has no column 'width'; its columns are: one, two"):
        a.population({"one": [1, 2], "two": [1, 2]}, {"top.A1": "width"})


@pytest.mark.parametrize(
    "text",
    [
        "one,two\n0.1,2\n-0.25,3\n",
        "sep=;\r\none;two\r\n0,1;2\r\n-0,25;3\r\n",
        "sep=,\none,two\n0.1,2\n-0.25,3\n",
        "one\ttwo\n0,1\t2\n-.25e0\t3\n",
        "# gauge 7\none [mm],two\n0.1,2\n# lunch\n\n\N{MINUS SIGN}0.25,3\n# mean -0.075\n\n",
        ' one , "two, too"\n 0.1 , 2\n-0.25,3\n',
        '"one\n[mm]";"two; or\ntoo"\n"0,1";2\n-0.25;"3\n# of them"\n',
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_tables_of_spreadsheets_are_read(text, encoding, tmp_path):
    a = cases.ra1()
    text = text.replace("\N{MINUS SIGN}", "-") if encoding == "cp1252" else text
    (tmp_path / "p.csv").write_bytes(text.replace("two", "Maß").encode(encoding))
    assert a.population(tmp_path / "p.csv", {"top.A1": "one"}).values.tolist() == [[0.1], [-0.25]]


def test_numbers_of_a_table_are_read_to_the_last_bit(tmp_path):
    numbers = np.random.default_rng(5).normal(size=2000) * 10.0 ** np.random.default_rng(6).integers(-12, 3, 2000)
    pd.DataFrame({"one": numbers}).to_csv(tmp_path / "p.csv", index=False)
    assert np.array_equal(cases.ra1().population(tmp_path / "p.csv", {"top.A1": "one"}).values[:, 0], numbers)


def test_measured_places_have_used_their_bonus():
    a = toleranced.ring_with("bore", tc.Size(10, 0.1, 0), tc.Position(0.2, "A|B", material="M"))
    a.population({"ring.bore.shift x": [0.05, -0.05], "ring.bore.size": [0.1, 0.1]})
    assert sorted(set(draws_of(a)["ring.bore.shift x"])) == [-0.05, 0.05]


def test_a_bonus_is_of_the_size_that_shared_causes_leave():
    said = {"material": "M", "rule": "translation"}
    a = toleranced.ring_with("bore", tc.Size(10, 0.1, 0, distribution="uniform"), tc.Position(0.1, "A|B", **said))
    a.variable("wear", tc.Tolerance(0.02, shift=-0.05), drives={"ring.bore.size": 1.0})
    drawn = draws_of(a)
    off, room = np.hypot(drawn["ring.bore.shift x"], drawn["ring.bore.shift y"]), 0.1 + np.maximum(drawn["ring.bore.size"], 0)
    low, high = stats.binom.interval(0.9999, SAMPLES, 0.9973)
    assert low <= (off <= room / 2).sum() <= high
