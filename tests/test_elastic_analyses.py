"""Analyses of elastic parts: those that simulate work, and others say why they do not and what to do instead."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import norm

import tolcontact as tc
from tests.cases import elastic as cases
from tests.helpers import compiled, nightly
from tests.test_elastic_parts import tips
from tests.test_elastic_stations import WholeSheets
from tolcontact.errors import OptionError

K = np.array([1.05, 8.4])
SLOPES = K / K.sum()  # of the height where the tips meet
SIGMA = 0.01 / 6 * np.linalg.norm(SLOPES)


def limited(folder, limit):
    """The tips with one measurement, the height where they meet, and limits of it."""
    model = tips(folder)
    (measure, *_) = model.measures
    return model.replaced(measures=[dataclasses.replace(measure, tolerance=None, limits=(-limit, limit))])


def allocated(model):
    """The root of the stiffer tip varies less, until nearly 2 % of the heights are beyond the limits."""
    found = tc.analyses.allocate(model, "left tip: ppm 20000", samples=2048, costs={"right root": 1.0})
    factor = found.factor.sel(group="right root").item()
    spread = 0.01 / 6 * np.linalg.norm(SLOPES * [1, factor])
    assert found.met.values.all()
    assert 0.01 < 2 * norm.sf(2 * SIGMA / spread) <= 0.02


def stacked(model):
    found = tc.analyses.stack_up(compiled(model, solver="graph"), samples=2000)["simulated"]
    found = found.sel(measure="left tip", state="corrected", interval="estimate")
    assert found.values == pytest.approx([-3 * SIGMA, 3 * SIGMA], rel=0.1)


def with_rare_events(model):
    probability = tc.analyses.tails(model, samples=30_000, solver="daqp")["probability"].sel(event="left tip outside limits")
    estimate, lower, upper = probability.values
    assert lower <= 0.0455003 <= upper < 1.2 * estimate  # beyond two sigma


@pytest.mark.parametrize("analysis", [stacked, *nightly(allocated, with_rare_events)])
def test_analyses_that_simulate_see_how_parts_bend(tmp_path, analysis):
    analysis(limited(tmp_path, 2 * SIGMA))


@pytest.mark.parametrize(
    ("analysis", "options", "said"),
    [
        ("worst_case", {}, 'part "left" of "tips" is elastic, .*; ask for tails, or run many realizations'),
        ("seating", {}, 'part "left" of "tips" is elastic, .*; leave elastic out, or look at the reactions of a run'),
        (
            "relocate",
            {"locator": "weld.left.A1", "between": ((0, 0, 0), (9, 0, 0)), "least": "left tip: 6 sigma"},
            r'locator "weld.left.A1" holds part "left", elastic, by left.npz, at a node .*; declare the part elastic by E',
        ),
        (
            "relocate",
            {"locator": "check.tips.A1", "between": ((0, 0, 0), (9, 0, 0)), "least": "left tip: 6 sigma"},
            r'locator "check.tips.A1" holds part "left"',
        ),
    ],
)
def test_other_analyses_say_why_not_and_what_instead(tmp_path, analysis, options, said):
    with pytest.raises(OptionError, match=said):
        getattr(tc.analyses, analysis)(tips(tmp_path), **options)


PLACE = (550, 200)
LABELS = [f"weld.{name}.L{k}" for name in cases.SHEETS for k in range(7)]


@pytest.fixture(scope="module")
def slopes(tmp_path_factory):
    """Heights of a corner per unit deviation of each locator (station, locator), by all freedoms of both meshes.

    There is no contact, so stations are linear: the second one keeps the gaps of the first at the welds.
    """
    folder = tmp_path_factory.mktemp("sheets")
    cases.welded_sheets(folder)  # which writes the matrices
    sheets = WholeSheets(folder, linear=True)
    placed = [sheets.at(name, sheets.place(name, x, y), n)[1] for name in cases.SHEETS for x, y, n in cases.PLACED[name]]
    guns = [sheets.across(x, y, "z")[1] for x, y in cases.WELDED]
    kept = np.array([sheets.across(x, y, axis)[1] for x, y in cases.WELDED for axis in "xyz"])
    free = [sheets.at(name, sheets.place(name, x, y), n)[1] for name, x, y, n in cases.FREE]
    rows, count = np.array([*placed, *guns, *sheets.means]), len(placed)
    clamped, _ = sheets.held(rows, np.eye(len(rows))[:, :count])
    targets = np.concatenate([np.zeros((len(free), count)), kept @ clamped, np.zeros((len(sheets.means), count))])
    released, _ = sheets.held(np.array([*free, *kept, *sheets.means]), targets)
    _, row = sheets.at("rear", sheets.place("rear", *PLACE), "z")
    return np.array([row @ clamped, row @ released])


def welded(folder, limit=None, *, contact=False):
    """The welded sheets with one corner measured in both stations; limits of the released one."""
    model = cases.welded_sheets(folder, tolerance=0.05, contact=contact, measured=(PLACE,))
    limits = [(-1.0, 1.0), (-limit, limit)] if limit else [(-1.0, 1.0)] * 2
    measures = [
        dataclasses.replace(measure, tolerance=None, limits=pair) for measure, pair in zip(model.measures, limits, strict=True)
    ]
    return model.replaced(measures=measures)


def test_sensitivities_of_welded_sheets_are_those_of_their_whole_meshes(tmp_path, slopes):
    """Heights differ by squares of rotations, which the whole meshes leave out."""
    found = tc.analyses.sensitivities(compiled(welded(tmp_path), solver="graph"), samples=20)["sensitivity"]
    found = found.sel(state="corrected", interval="estimate", contributor=LABELS).transpose("measure", ...)
    assert np.abs(slopes[1]).max() > 0.3  # they spring back by less than they were bent
    assert found.values == pytest.approx(slopes, abs=1e-3)


def test_contributions_to_the_released_sheets_are_those_of_their_whole_meshes(tmp_path, slopes):
    found = tc.analyses.contributions(compiled(welded(tmp_path), solver="graph"), samples=512)
    first = found["first"].sel(state="corrected", group=LABELS)
    for measure, row in zip(first.measure.values, slopes**2 / (slopes**2).sum(axis=1, keepdims=True), strict=True):
        share, lower, upper = (first.sel(measure=measure, interval=side).values for side in ("estimate", "lower", "upper"))
        assert (np.abs(share - row) <= upper - lower + 5e-3).all()  # four standard errors
        assert (upper - lower).max() < 0.3


@pytest.mark.nightly
def test_rare_events_and_allocation_of_welded_sheets_follow_from_their_slopes(tmp_path, slopes):
    sigma = 0.05 / 6 * np.linalg.norm(slopes[1])
    rare = tc.analyses.tails(welded(tmp_path, 3.5 * sigma), samples=30_000, solver="graph")["probability"]
    estimate, lower, upper = rare.sel(event="check 0 outside limits").values
    assert lower <= 2 * norm.sf(3.5) <= upper < 1.5 * estimate
    found = tc.analyses.allocate(welded(tmp_path, 2 * sigma), "check 0: ppm 20000", samples=512, solver="graph")
    spread = 0.05 / 6 * np.linalg.norm(slopes[1] * found.factor.sel(group=LABELS).values)
    assert found.met.values.all()
    assert 2 * norm.sf(2 * sigma / spread) <= 0.022


@pytest.mark.parametrize(
    ("analysis", "said"),
    [
        ("worst_case", 'part "front" of "welded sheets" is elastic, .*; ask for tails, or run many realizations'),
        ("seating", 'part "front" of "welded sheets" is elastic, .*; leave elastic out, or look at the reactions of a run'),
    ],
)
def test_welded_sheets_are_refused_where_parts_have_to_be_rigid(tmp_path, analysis, said):
    with pytest.raises(OptionError, match=said):
        getattr(tc.analyses, analysis)(welded(tmp_path, contact=True))


def test_analyses_of_welded_sheets_in_contact_work_and_count_all_of_their_variance(tmp_path):
    """Total shares of independent deviations add up to one or more; contact makes them interact."""
    program = compiled(welded(tmp_path, contact=True), solver="graph")
    found = tc.analyses.contributions(program, samples=256)["total"].sel(state="corrected")
    upper = found.sel(interval="upper").sum("group")
    assert (upper >= 1).all() and (found.sel(interval="lower").sum("group") <= 1.5).all()
    moved = tc.analyses.sensitivities(program, samples=20)["sensitivity"].sel(state="corrected", interval="estimate")
    assert np.isfinite(moved.values).all()
