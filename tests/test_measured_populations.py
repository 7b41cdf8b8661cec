"""Populations as shops measure them: with the scatter of a gauge, in lots, with gaps in their tables."""

import numpy as np
import pandas as pd
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import assembly_of, compiled

FEET = {"top.A1": "one", "top.A2": "two"}


def normal(*shape, seed=4):
    return np.random.default_rng(seed).normal(size=shape)


def correlated(parts=40):
    """Two correlated columns [mm], with their covariance as it is in these parts."""
    first = 0.05 * normal(parts)
    return pd.DataFrame({"one": first, "two": 0.6 * first + 0.03 * normal(parts, seed=5) + 0.01})


def drawn_of(model, count=4000):
    program = compiled(model)
    return program, dict(zip(program.draws.labels, program.draws(seed=1, start=0, stop=count).T, strict=True))


@pytest.mark.parametrize("gauge", [0.02, {"top.A2": 0.02}])
def test_the_variance_of_a_gauge_is_taken_off_and_covariances_stay(gauge):
    table, a = correlated(), cases.ra1()
    population = a.population(1000 * table, FEET, units="um", gauge=20 if gauge == 0.02 else {"top.A2": 20})
    off = np.diag([0.02**2 if gauge == 0.02 else 0.0, 0.02**2])
    assert np.cov(population.drawn.T) == pytest.approx(np.cov(table.T) - off, rel=1e-9)
    assert population.drawn.mean(axis=0) == pytest.approx(table.mean().values)
    program, drawn = drawn_of(a, 400)
    assert {tuple(row) for row in np.round(population.drawn, 12)} >= {
        tuple(row) for row in np.round(np.stack([drawn[label] for label in FEET], axis=1), 12)
    }
    (line,) = [line for line in program.draws.in_words if line.startswith("measured parts,")]
    spread = table.two.std()
    assert f"top.A2 0.02, so {np.sqrt(spread**2 - 0.02**2):.3g} after {spread:.3g}" in line


def test_one_column_shrinks_towards_its_mean_and_archives_hold_both(tmp_path):
    values = np.round(0.01 * normal(30), 4)
    stack = tc.Stack("gauge")
    stack.link("bushing", 40, 0.1)
    stack.gap("play", limits=(39.9, 40.1))
    population = stack.population({"bushing": values}, gauge=0.004)
    shrunk = values.mean() + (values - values.mean()) * np.sqrt(1 - (0.004 / values.std(ddof=1)) ** 2)
    assert population.drawn[:, 0] == pytest.approx(shrunk, abs=1e-15)
    results = tc.run(stack, samples=2000, seed=1, keep="all")
    assert "gauge is taken off: bushing 0.004" in results.attrs["correlations"]
    tc.io.write_model(stack, tmp_path / "stack.json")
    for again in (tc.io.model_of(results), assembly_of(tmp_path / "stack.json")):
        assert np.array_equal(again.populations[0].drawn, population.drawn)
    spread = tc.summarize(results).statistic_value.sel(measure="play", state="raw", statistic="6 sigma").values
    assert 0.7 < spread[1] / spread[0] < 0.9 and 1.1 < spread[2] / spread[0] < 1.3  # of thirty parts, the rows recognized


def test_a_gauge_coarser_than_the_parts_is_refused():
    a = cases.ra1()
    a.population({"top.A1": [0.01, 0.012, 0.011]}, gauge=0.002)
    assert "gauge is 0.002, and the measured values of top.A1 scatter by 0.001 (standard deviation)" in tc.check(a)[0]
    a, first = cases.ra1(), 0.05 * normal(30)
    a.population({"one": first, "two": first + 0.001 * normal(30, seed=5)}, FEET, gauge=0.02)
    assert "gauge is larger than the spread of some combination of the columns" in tc.check(a)[0]
    with pytest.raises(ValueError, match=r'gauge has "top.A3"; its contributors are: top.A1, top.A2'):
        a.population(correlated(), FEET, gauge={"top.A3": 0.01})
    for gauge in ({"top.A1": "0.01"}, {"top.A1": None}, float("nan")):
        with pytest.raises(ValueError, match=r"gauge is .*; expected a standard uncertainty, or one for each label"):
            a.population(correlated(), FEET, gauge=gauge)
    assert a.population(correlated(), FEET, gauge=np.float32(0.01)).gauge == pytest.approx((0.01, 0.01))


@pytest.mark.parametrize("gauge", [0.1, {"top.A1": 0.1}])
def test_columns_without_a_spread_of_their_own_leave_none_to_a_gauge(gauge):
    """Of two proportional columns, or of as many rows as columns, some combination has no variance to take off."""
    a = cases.ra1()
    a.population({"one": [1.0, 2.0, 3.0, 4.0], "two": [2.0, 4.0, 6.0, 8.0]}, FEET, gauge=gauge)
    assert "of some combination of the columns, which correlate more than its scatter allows" in tc.check(a)[0]


def test_realizations_draw_a_lot_and_then_a_part_of_it():
    """Lots of 2, 8 and 40 parts have a third of the realizations each, and each part its share of that."""
    lots = ["a"] * 2 + ["b"] * 8 + ["c"] * 40
    table = pd.DataFrame({"one": 0.001 * np.arange(50), "lot": lots}).sample(frac=1, random_state=2)
    a = cases.ra1()
    a.population(table, {"top.A1": "one"}, lots="lot")
    _, drawn = drawn_of(a, 30_000)
    rows = np.rint(1000 * drawn["top.A1"]).astype(int)
    counts = np.bincount(rows, minlength=50)
    expected = 10_000 / np.repeat([2, 8, 40], [2, 8, 40])
    assert (np.abs(counts - expected) < 4.5 * np.sqrt(expected)).all()


def test_spreads_between_and_within_lots_are_those_of_the_analysis_of_variance():
    lots, parts = 400, 5
    means = 0.02 * normal(lots)
    table = pd.DataFrame({"one": (means[:, None] + 0.01 * normal(lots, parts, seed=5)).ravel()})
    table["lot"] = [f"lot {k}" for k in range(lots) for _ in range(parts)]
    a = cases.ra1()
    population = a.population(table, {"top.A1": "one"}, lots="lot", gauge=0.006)
    assert population.within == pytest.approx([0.01], rel=0.06) and population.between == pytest.approx([0.02], rel=0.1)
    drawn = pd.DataFrame({"one": population.drawn[:, 0], "lot": table.lot}).groupby("lot").one
    assert drawn.mean().values == pytest.approx(table.groupby("lot").one.mean().values)
    assert np.sqrt(drawn.var().mean()) == pytest.approx(np.sqrt(population.within[0] ** 2 - 0.006**2))
    assert "400 lots, drawn with equal odds; spread between and within: top.A1 0.0" in population.in_words
    assert "rows in 400 lots of top.A1, gauge taken off" in str(population)


def test_what_few_lots_leave_open_is_in_the_intervals():
    """No part is outside: at most 1 - 0.025^(1/lots) of all lots are, as Clopper and Pearson say; and a mean is wider."""
    figures = {}
    for lots in (None, "lot"):
        stack = tc.Stack("lots")
        stack.link("disc", 0, 0.1)
        stack.gap("gap", limits=(-0.1, 0.1))
        parts = np.repeat(np.linspace(-0.02, 0.02, 6), 10) + np.tile(np.linspace(-0.001, 0.001, 10), 6)
        table = pd.DataFrame({"disc": parts, "lot": np.repeat(list("abcdef"), 10)})
        stack.population(table if lots else table[["disc"]], lots=lots)
        results = tc.run(stack, samples=4000, seed=1, keep="all")
        values = tc.summarize(results).statistic_value.sel(measure="gap", state="raw")
        figures[lots] = [values.sel(statistic=name).values for name in ("mean", "outside limits")]
    width = {lots: mean[2] - mean[1] for lots, (mean, _) in figures.items()}
    assert 2 < width["lot"] / width[None] < 4.5
    for lots, known in ((None, 60), ("lot", 6)):
        assert figures[lots][1][2] == pytest.approx(1 - 0.025 ** (1 / known), rel=0.03)


@pytest.mark.parametrize("kind", ["file", "frame"])
def test_rows_with_gaps_are_refused_or_left_out_as_a_whole(kind, tmp_path):
    table = pd.DataFrame({"one": [0.1, None, 0.3, 0.4], "two": [1.0, 2.0, None, 4.0], "three": [1.0, 1.0, 1.0, None]})
    source = table if kind == "frame" else tmp_path / "report.csv"
    if kind == "file":
        table.to_csv(source, index=False, sep=";")
        with pytest.raises(ValueError, match=r'line 3, column "one" is empty.*gaps="left out" leaves out the rows with empty'):
            cases.ra1().population(source, FEET)
    a = cases.ra1()
    population = a.population(source, FEET, gaps="left out")
    assert population.values.tolist() == [[0.1, 1.0], [0.4, 4.0]] and population.left_out == 2
    assert "2 of 4 rows had gaps and are left out" in population.in_words
    texts = a.population({"one": ["0.1", " ", "0.3"], "two": ["1", "2", "3"]}, FEET, gaps="left out")
    assert texts.values.tolist() == [[0.1, 1.0], [0.3, 3.0]]
    b = cases.ra1()
    b.population(table, FEET)
    assert 'gaps="left out" leaves out rows with empty cells' in tc.check(b)[0]
    with pytest.raises(ValueError, match="gaps is 'ignored'; expected one of: refused, left out"):
        a.population(source, FEET, gaps="ignored")
    with pytest.raises(ValueError, match="each of its 4 rows has a gap"):
        a.population(table.assign(one=np.nan), FEET, gaps="left out")
    with pytest.raises(ValueError, match=r"(line 3|row 2) has no lot; name it"):
        a.population(source, {"top.A1": "three"}, lots="one", gaps="left out")


def test_a_column_of_lots_is_named_as_in_the_heading_and_is_no_contributor():
    a, table = cases.ra1(), {"top.A1": [0.1, 0.2, 0.3, 0.4], "lot (no)": list("AABB")}
    assert [a.population(table, lots=name).columns for name in ("lot (no)", "lot")] == [("top.A1",)] * 2
    with pytest.raises(TypeError, match="lots is a list; expected the name of a column"):
        a.population(table, lots=list("AABB"))


def test_a_column_of_names_is_left_out_by_those_that_are_read(tmp_path):
    (tmp_path / "report.csv").write_text("table.A1,inspector\n0.1,Jo\n0.2,Jo\n")
    a = tc.Assembly("report")
    with pytest.raises(ValueError, match=r'column "inspector" is "Jo".*; columns={label: column} reads these columns alone'):
        a.population(tmp_path / "report.csv")
    assert a.population(tmp_path / "report.csv", {"table.A1": "table.A1"}).columns
