"""Derivatives through contact: closed forms, differences by hand, what jumps."""

import io
import json
import re

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

import tolcontact as tc
from tests import cases
from tests.helpers import call, compiled
from tests.test_ra1 import BASE, MEASURED, TOP, plane_weights
from tolcontact import vocabulary as terms
from tolcontact.discretization import discretize
from tolcontact.report import analysis_text
from tolcontact.simulation import simulate_block


@pytest.fixture(scope="module")
def of_ra1():
    return tc.analyses.sensitivities(cases.model("ra1"), samples=400, solver="daqp").sel(measure="corner height")


def test_without_contact_they_are_those_of_the_plane_through_the_locators(of_ra1):
    for k, weight in enumerate(plane_weights(TOP, MEASURED), start=1):
        assert float(of_ra1["nominal"].sel(contributor=f"top.A{k}")) == pytest.approx(weight, abs=1e-6)
        estimate, _, _ = of_ra1["by_contact"].sel(contact="untouched", contributor=f"top.A{k}").values
        assert estimate == pytest.approx(weight, abs=0.05)  # the second order of 10 mm on 50 mm
    assert (of_ra1["nominal"].sel(contributor=[f"base.A{k}" for k in (1, 2, 3)]) == 0).all()


def test_leverage_of_locators():
    """Against the twist that the six locators allow."""
    a = tc.Assembly("lever")
    part = a.part("plate", tc.Box(100, 50, 10))
    a.part("ground", tc.Box(5, 5, 5), at=(0, 0, -5), fixed=True)
    a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=10), tolerance=0.1)
    a.variable("heat", 0.1, drives={"plate.C1": 1.0})
    a.measure("corner", part.point(100, 50, 10), along="z")
    found = tc.analyses.sensitivities(a, samples=2, solver="daqp")["leverage"]
    assert np.isnan(found.sel(contributor="heat")) and float(found.sel(contributor="plate.C1")) == pytest.approx(1, abs=1e-6)
    own = discretize(a).parts[0].locators
    twists = np.linalg.inv(np.hstack([own.directions, np.cross(own.points, own.directions)]))  # columns: t, w for each locator
    corners = np.array([(x, y, z) for x in (0, 100) for y in (0, 50) for z in (0, 10)])
    for label, twist in zip(own.labels, twists.T, strict=True):
        farthest = np.linalg.norm(twist[:3] + np.cross(twist[3:], corners), axis=1).max()
        assert float(found.sel(contributor=label)) == pytest.approx(farthest, abs=1e-6)


def test_with_contact_they_are_those_of_the_plane_below(of_ra1):
    """A top that touches with planar faces lies flush on the base, and follows the base alone."""
    touched = of_ra1["by_contact"].sel(contact="touched")
    for k, weight in enumerate(plane_weights(BASE, MEASURED), start=1):
        assert float(touched.sel(contributor=f"base.A{k}", interval="estimate")) == pytest.approx(weight, abs=0.05)
        assert abs(float(touched.sel(contributor=f"top.A{k}", interval="estimate"))) < 0.05
    assert 0 < float(of_ra1["changing"].sel(contributor="top.A3", interval="estimate")) < 0.2


def test_one_dimensional_contact_is_followed_in_half_of_the_realizations():
    """The derivative of max(0, g) is 0 or 1, each in half of the draws."""
    found = tc.analyses.sensitivities(cases.one_dimensional(0), samples=2000, solver="daqp").isel(measure=0)
    of = found.sel(contributor="block.Z")
    estimate, lower, upper = of["sensitivity"].sel(state="corrected").values
    assert lower < 0.5 < upper and upper - lower < 0.05 and estimate == pytest.approx(0.5, abs=0.03)
    assert of["by_contact"].sel(interval="estimate").values == pytest.approx([1.0, 0.0], abs=1e-7)
    assert float(of["spread"].sel(state="corrected")) == pytest.approx(0.5, abs=0.02)
    assert float(of["sensitivity"].sel(state="raw", interval="estimate")) == pytest.approx(1, abs=1e-9)


@pytest.mark.nightly
@pytest.mark.slow
def test_intervals_cover():
    """500 repeats of 100 realizations: the mean derivative of max(0, g) is 0.5."""
    program, inside = compiled(cases.one_dimensional(0), solver="daqp"), 0
    for seed in range(500):
        found = tc.analyses.sensitivities(program, samples=100, seed=seed).isel(measure=0)
        _, lower, upper = found["sensitivity"].sel(state="corrected", contributor="block.Z").values
        inside += lower <= 0.5 <= upper
    assert 460 <= inside <= 490


def test_a_clutch_follows_its_drawing_as_its_formula_says():
    """By hand (-11.910, -23.732, 11.821) degrees a mm; roller and ring vary in diameter. Means differ in the second order."""
    found = tc.analyses.sensitivities(cases.model("clutch"), samples=200, solver="daqp").isel(measure=0).sel(state="corrected")
    expected = {"hub.flat.offset": -11.910, "roller.barrel.size": -23.732 / 2, "ring.bore.size": 11.821 / 2}
    for label, slope in expected.items():
        estimate, lower, upper = found["sensitivity"].sel(contributor=label).values
        assert abs(estimate - slope) < 0.01 * abs(slope) and upper - lower < 0.02 * abs(slope)


@pytest.mark.slow
def test_they_are_differences_of_the_engine():
    a = cases.model("lid")
    program = compiled(a, solver="daqp", method=a.method)
    found = tc.analyses.sensitivities(program, samples=6, seed=4)
    own = program.draws(seed=4, start=0, stop=6)
    for label in found["contributor"].values[::9]:
        column, step = list(program.nominal.contributors).index(label), float(found["step"].sel(contributor=label))
        blocks = []
        for sign in (1, -1):
            moved = own.copy()
            moved[:, column] += sign * step
            blocks.append(simulate_block(program, moved).measured)
        slopes = (blocks[0] - blocks[1]) / (2 * step)
        expected = found["sensitivity"].sel(contributor=label, interval="estimate").transpose("state", "measure")
        assert slopes.mean(axis=0) == pytest.approx(expected.values, abs=1e-4)


def test_the_command_prints_a_table_json_and_csv(tmp_path):
    options = ("sensitivities", cases.MODELS / "ra1.py", "--samples", "32", "--solver", "daqp")
    done = call(tmp_path, *options)
    assert done.returncode == 0 and "touching" in done.stdout, done.stderr
    said = json.loads(call(tmp_path, *options, "--json").stdout, parse_constant=pytest.fail)
    assert said["attrs"]["simulated"] == 32 * 25
    table = pd.read_csv(io.StringIO(call(tmp_path, *options, "--csv").stdout))
    assert set(table["contributor"]) >= {"top.A1", "base.C1"} and {"estimate", "lower", "upper"} <= set(table)
    assert call(tmp_path, *options, "--csv", "--json").returncode == 2


def test_the_table_lists_what_has_an_effect_whatever_its_units():
    stack = tc.Stack("units")
    stack.link("length", 10, 0.02)
    stack.link("aside", 10, 0.02, sensitivity=1e-5)
    stack.link("heat", 0, 60, sensitivity=6e-4)  # up to 30 K, 0.018 mm
    stack.gap("gap")
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(analysis_text(terms.SENSITIVITIES, tc.analyses.sensitivities(stack, samples=8)))
    listed = re.findall(r"^(heat|length|aside|and 1 with next to no effect)", console.export_text(), flags=re.MULTILINE)
    assert listed == ["heat", "length", "and 1 with next to no effect"]


def test_what_does_nothing_has_no_kinks():
    """Rounding of a solver is no kink: the lid's height above its base follows nothing."""
    a = cases.one_dimensional(0)
    a.measure("aside", a.parts[1].point(5, 5, 10), along="x")
    found = tc.analyses.sensitivities(a, samples=200, solver="daqp")
    assert float(found["changing"].sel(contributor="block.Z", interval="estimate")) < 0.05
    derivatives = found["sensitivity"].sel(measure="aside")  # equal in all realizations, which tells nothing of their spread
    assert np.abs(derivatives.sel(interval="estimate").values).max() < 1e-6
    assert np.isnan(derivatives.sel(interval=["lower", "upper"]).values).all()
