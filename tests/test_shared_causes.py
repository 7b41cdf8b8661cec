"""Shared causes in analyses: contributors of their own, with all that they drive, against closed forms."""

import numpy as np
import pytest
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.cases import toleranced
from tests.test_contributions import of_clipped, of_normal
from tests.test_ra1 import plane_weights
from tolcontact.discretization import discretize

SUPPORTS = ("A1", "A2", "A3")


def shelf(causes, tolerance=0.0):
    """A block on a table, which causes move up and down by their weights: its height is max(0, sum of weight * cause)."""
    a = tc.Assembly("shelf")
    table = a.part("table", tc.Box(100, 50, 10), fixed=True)
    block = a.part("block", tc.Box(50, 25, 10), at=(25, 12.5, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=tolerance)
    a.contact("under", moving=block.face("-z"), reference=table.face("+z"), points=12)
    for name, weight in causes.items():
        a.variable(name, 0.6, drives={f"block.{support}": weight for support in SUPPORTS})
    a.measure("height", block.point(25, 12.5, 10), along="z")
    return a


def test_independent_causes_of_the_same_locators_have_their_own_shares():
    found = tc.analyses.contributions(shelf({"a": 1.0, "b": 0.5}), samples=4096, solver="daqp").sel(measure="height")
    assert found["group"].values.tolist() == ["a", "b"] and not found.sizes["unit"]
    assert found["linear"].values == pytest.approx([0.8, 0.2], abs=1e-9)
    truths = {"raw": [[0.8, 0.2]] * 2, "corrected": of_clipped()}
    for state, truth in truths.items():
        for word, shares in zip(("first", "total"), truth, strict=True):
            for group, share in zip("ab", shares, strict=True):
                estimate, lower, upper = found[word].sel(state=state, group=group).values
                assert abs(estimate - share) < 1.7 * (upper - lower) / 2 + 1e-3 and upper - lower < 0.15, (state, word, group)
    missed = found["missed"].sel(interval="estimate")
    assert float(missed.sel(state="raw")) < 1e-9 and float(missed.sel(state="corrected")) > 0.5
    by_part = tc.analyses.contributions(shelf({"a": 1.0, "b": 0.5}, tolerance=0.3), samples=64, solver="daqp", by="part")
    assert by_part["group"].values.tolist() == ["block", "a", "b"]


def test_a_driven_locator_has_the_share_of_its_own_variation():
    a = tc.Assembly("shelf")
    block = a.part("block", tc.Box(50, 25, 10))
    places = {"Z1": (5, 5, 0), "Z2": (45, 5, 0), "Z3": (25, 20, 0), "Y1": (10, 0, 5), "Y2": (40, 0, 5), "X": (0, 12.5, 5)}
    a.locate(block, [tc.Locator(name, p, name[0].lower(), 0.3 if name == "X" else 0) for name, p in places.items()])
    a.variable("heat", tc.Tolerance(5, "uniform"), drives={"block.X": -0.02, "block.Y1": 0.01, "block.Y2": 0.01}, units="K")
    a.measure("along", block.point(0, 0, 0), along="x")
    a.measure("across", block.point(0, 0, 0), along="y")
    slopes = tc.analyses.sensitivities(a, samples=16, solver="daqp").sel(state="raw", interval="estimate")
    assert slopes["contributor"].values.tolist() == ["block.X", "heat"]
    expected = np.array([[1, -0.02], [0, 0.01]])  # (measure, contributor)
    assert slopes["nominal"].values == pytest.approx(expected, abs=1e-9)
    assert slopes["sensitivity"].values == pytest.approx(expected, abs=1e-9)
    assert slopes["step"].values == pytest.approx([0.01 * 0.3 / 6, 0.01 * 5 / np.sqrt(12)], rel=0.02)
    shares = tc.analyses.contributions(a, samples=2048, solver="daqp")
    assert shares["group"].values.tolist() == ["block.X", "heat"]
    parts = np.array([(0.3 / 6) ** 2, (0.02 * 5) ** 2 / 12])
    truth = np.array([parts / parts.sum(), [0, 1]])
    assert shares["linear"].values == pytest.approx(truth, abs=1e-9)
    for word in ("first", "total"):
        estimate, lower, upper = shares[word].sel(state="raw").transpose("interval", ...).values
        assert (np.abs(estimate - truth) < 1.7 * (upper - lower) / 2 + 1e-9).all(), word


def test_a_derivative_is_the_sum_over_what_is_driven_also_with_negative_weights():
    weights = np.array([1.0, -0.5, -2.0])
    a = shelf({}, tolerance=0.3)
    a.variable("warp", 0.2, drives=dict(zip((f"block.{support}" for support in SUPPORTS), weights, strict=True)))
    found = tc.analyses.sensitivities(a, samples=64, solver="daqp").sel(measure="height")
    supports = [f"block.{support}" for support in SUPPORTS]
    points = discretize(a).parts[1].locators.points
    expected = plane_weights(points[:3, :2], np.array([50, 25]))
    assert found["nominal"].sel(contributor=supports).values == pytest.approx(expected, abs=1e-9)
    assert float(found["nominal"].sel(contributor="warp")) == pytest.approx(expected @ weights, abs=1e-9)
    raw = found["sensitivity"].sel(state="raw", interval="estimate")
    assert float(raw.sel(contributor="warp")) == pytest.approx(raw.sel(contributor=supports).values @ weights, abs=1e-6)


@pytest.mark.slow
def test_correlated_causes_are_one_group_with_a_shapley_effect_each():
    a = shelf({"a": 1.0, "b": 0.5})
    a.correlate(["a", "b"], 0.6)
    found = tc.analyses.contributions(a, samples=4096, solver="daqp").sel(measure="height")
    assert found["group"].values.tolist() == ["a + b"] and found["unit"].values.tolist() == ["a", "b"]
    assert found["linear"].values == pytest.approx([1.0])
    for unit, truth in zip("ab", of_normal([1, 0.5], [[1, 0.6], [0.6, 1]]), strict=True):
        estimate, lower, upper = found["shapley"].sel(state="raw", unit=unit).values
        assert abs(estimate - truth) < 1.7 * (upper - lower) / 2 + 1e-3 and upper - lower < 0.1
    assert found["shapley"].sel(interval="estimate").sum("unit").values == pytest.approx([1, 1])


def test_a_cause_that_drives_a_feature():
    a = toleranced.block_with("top", tc.Profile(0.3, "A", rule="translation"))
    a.variable("warmth", 20, drives={"block.top.offset": 0.01}, units="K")
    slopes = tc.analyses.sensitivities(a, samples=16, solver="daqp").sel(measure="middle")
    assert slopes["contributor"].values.tolist() == ["block.top.offset", "warmth"]
    assert slopes["nominal"].values == pytest.approx([1, 0.01], abs=1e-9)
    parts = np.array([0.3**2, (0.01 * 20) ** 2])
    shares = tc.analyses.contributions(a, samples=64, solver="daqp", by="feature").sel(measure="middle")
    assert shares["group"].values.tolist() == ["block.top", "warmth"]
    assert shares["linear"].values == pytest.approx(parts / parts.sum(), rel=1e-3)


def test_groups_are_named_after_what_varies():
    a = cases.stack()
    a.locate(
        a.part("still", tc.Box(10, 10, 10)), tc.three_two_one(*(a.parts[-1].face(f"-{axis}") for axis in "zyx")), tolerance=0
    )
    a.correlate(["still.A1", "upper.A1"], 0.8)
    groups = tc.analyses.contributions(a, samples=16, solver="daqp")["group"].values.tolist()
    assert "upper.A1" in groups and not any("still" in group for group in groups)


def test_a_distribution_without_a_variance_has_that_of_its_draws():
    a = shelf({"a": 1.0})
    a.variable("b", stats.cauchy(0, 1e-4), drives={f"block.{support}": 1.0 for support in SUPPORTS})
    linear = tc.analyses.contributions(a, samples=16, solver="daqp")["linear"].sel(measure="height").values
    assert (linear > 0).all() and linear.sum() == pytest.approx(1)
