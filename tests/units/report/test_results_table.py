"""The table of results: verdicts, one unit for all shares, and figures without noise."""

import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tolcontact.report.results_table import result_rows, share_heading, share_in, share_units, verdict_lines, verdict_text
from tolcontact.report.table import nominal_and_limits, plain
from tolcontact.statistics import intervals
from tolcontact.statistics.capability import ALLOWED_SHARE, FAILS, MEETS, UNDECIDED, verdict


@pytest.mark.parametrize(
    ("hits", "count", "word"),
    [
        (0, 1000, UNDECIDED),
        (0, 1365, MEETS),
        (0, 1364, UNDECIDED),
        (27, 10_000, UNDECIDED),
        (60, 10_000, FAILS),
        (5, 10_000, MEETS),
    ],
)
def test_verdicts_are_those_of_the_interval(hits, count, word):
    """Without a hit the upper end is 1 - 0.025^(1/n), which is 0.27 % at n = 1364.4."""
    opinion = verdict(np.array(intervals.proportion_of(hits, count)), count)
    assert opinion.word == word and (opinion.more > 0) == (word == UNDECIDED)


def test_the_realizations_that_would_decide_are_enough_but_not_far_too_many():
    opinion = verdict(np.array(intervals.proportion_of(0, 200)), 200)
    needed = np.log(0.025) / np.log1p(-ALLOWED_SHARE)
    assert needed - 200 <= opinion.more <= 1.3 * needed


@pytest.mark.parametrize("count", [300, 1500, 6000, 100_000, 1_000_000])
def test_the_number_that_would_decide_is_no_accident_of_a_share_that_seems_to_be_the_allowed_one(count):
    """At the allowed share it is that of a median distance: z^2 / 0.6745^2, about 8.4 times as many realizations."""
    for hits in np.arange(int(ALLOWED_SHARE * count), ALLOWED_SHARE * count + 2):
        more = verdict(np.array(intervals.proportion_of(float(hits), float(count))), count).more
        assert 1.8 * count < more < 12 * count


def test_a_still_measure_of_assemblies_that_may_not_go_together_has_the_verdict_of_their_share():
    share = np.array(intervals.proportion_of(1, 1500))
    assert verdict(share, 1500, varies=False) == verdict(share, 1500) and verdict(share, 1500).word == UNDECIDED


def test_a_measure_that_does_not_vary_needs_no_more_realizations():
    a = tc.Assembly("still")
    block = a.part("block", tc.Box(50, 25, 10), rotation=(0.3, -1.2, 0.7))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0)
    other = a.part("other", tc.Box(50, 25, 10), at=(0, 100, 0))
    a.locate(other, tc.three_two_one(other.face("-z"), other.face("-y"), other.face("-x")), tolerance=0.1)
    a.measure("moves", other.point(0, 0, 0), along="z", tolerance=0.1)
    for name, limits in {"within": (-0.1, 0.1), "beyond": (0.05, 0.1)}.items():
        a.measure(name, block.point(50, 0, 0), along="x", limits=limits)
    summary = tc.summarize(tc.run(a, samples=300, seed=1, solver="daqp"))
    _, *lines = verdict_lines(summary)
    assert lines == ["within: does not vary", "beyond: does not meet its limits"]
    assert [row.is_good for row in result_rows(summary)][1:] == [None, False]


def test_without_limits_there_is_no_verdict():
    assert verdict(np.full(3, np.nan), 100) is None and verdict_text(None) == ""


def assembly(limits):
    a = cases.stack()
    block = a.parts[-1]
    for name, bounds in limits.items():
        a.measure(name, block.point(0, 0, 0), along="z", limits=bounds)
    return a


def test_each_measurement_has_a_row_with_its_verdict():
    names = {"wide": (-100, 100), "narrow": (-1e-4, 1e-4), "open": None}
    summary = tc.summarize(tc.run(assembly(names), samples=2000, seed=1, solver="daqp"))
    rows = {row.name: row for row in result_rows(summary)}
    assert [rows[name].verdict for name in names] == ["meets", "does not meet", ""]
    assert [rows[name].is_good for name in names] == [True, False, None]
    assert rows["wide"].limits == ("0", "-100", "100") and rows["open"].limits == ("0", "", "")
    assert [figures.state for figures in rows["wide"].states] == ["with contact", "without contact"]
    undefined = summary.copy(deep=True)
    undefined["statistic_value"][:] = np.nan
    undefined["measure_not_a_number"][:] = 250
    verdicts = {row.name: row.verdict for row in result_rows(undefined)}
    assert (verdicts["wide"], verdicts["open"]) == ("not a number in 12 % of the realizations", "")
    lines = list(verdict_lines(summary))
    assert "wide: meets its limits" in lines and not [line for line in lines if line.startswith("open")]


def test_all_shares_of_a_table_have_one_unit():
    summary = tc.summarize(tc.run(assembly({"wide": (-100, 100)}), samples=300, seed=1, solver="daqp"))
    few, many = (summary.copy(deep=True) for _ in range(2))
    outside = {"statistic": "outside limits", "interval": "estimate"}
    few["statistic_value"].loc[outside], many["statistic_value"].loc[outside] = 0.0099, 0.01
    assert (share_units(few), share_units(many)) == ("ppm", "%")
    assert share_heading(few) == "out of specification, ppm"
    share = np.array([0.0123, 0.0111, 0.0135])
    assert share_in(share, "ppm") == "12 300 [11 100, 13 500]" and share_in(share, "%") == "1.23 [1.11, 1.35]"
    assert share_in(np.full(3, np.nan), "%") == "-"


@pytest.mark.parametrize(
    ("value", "scale", "text"),
    [
        (-0.400001, 0.8, "-0.4"), (-0.400001, None, "-0.4"), (0.1 + 0.2, None, "0.3"), (12.3456, 1.0, "12.3456"),
        (1e-7, 1.0, "0"), (1e-7, None, "1e-07"), (-0.0, 1.0, "0"), (450.0, 1.0, "450"), (np.inf, 1.0, ""), (np.nan, None, ""),
        (0.025, 0.05, "0.025"),
        (1 / 3, 1.0, "0.33333"), (-2e-17, 0.5, "0"),
    ],
)  # fmt: skip
def test_declared_values_are_without_noise(value, scale, text):
    assert plain(value, scale) == text


def test_sides_without_a_limit_have_no_noise_either():
    summary = tc.summarize(tc.run(assembly({"one": (None, 0.5)}), samples=100, seed=1, solver="daqp"))
    assert isinstance(summary, xr.Dataset)
    (row,) = [row for row in result_rows(summary) if row.name == "one"]
    assert row.limits == ("0", "", "0.5") and row.states[0].cells[3] == "-" and "[" in row.states[0].cells[4]


def test_a_nominal_value_of_rounding_is_nothing_beside_its_limits():
    assert nominal_and_limits(2.04281e-14, -np.inf, 0.15) == ("0", "", "0.15")
    assert nominal_and_limits(42.0000000000001, 41.9, 42.1) == ("42", "41.9", "42.1")
    assert nominal_and_limits(0.0, -np.inf, np.inf) == ("0", "", "")
