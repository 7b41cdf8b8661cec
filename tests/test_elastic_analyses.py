"""Analyses of elastic parts: those that simulate work, and others say why they do not and what to do instead."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import norm

import tolcontact as tc
from tests.helpers import nightly
from tests.test_elastic_parts import tips
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
    found = tc.analyses.stack_up(model, samples=2000)["simulated"].sel(measure="left tip", state="corrected")
    assert found.sel(interval="estimate").values == pytest.approx([-3 * SIGMA, 3 * SIGMA], rel=0.1)


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
