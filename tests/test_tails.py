"""Rare events: known probabilities, intervals that cover, and what leads to them."""

import io
import json

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, call, nightly


def limited(limit):
    """A block on a block, whose corrected height is max(0, g), g ~ N(0, 1), above nominal."""
    a = cases.one_dimensional(0)
    a.measure("kept", a.parts[1].point(5, 5, 10), along="z", limits=(None, limit))
    return a


@pytest.mark.slow
def test_a_limit_far_out_is_exceeded_as_often_as_the_closed_form_says():
    found = tc.analyses.tails(limited(4.5), samples=30_000, seed=2, solver="daqp", method=PAPER)
    assert found.event.values.tolist() == ["kept outside limits"]
    estimate, lower, upper = found.probability.values[0]
    assert lower < stats.norm.sf(4.5) < upper and upper - lower < 4 * estimate
    assert int(found.simulated[0]) == int(found.by_status.sum()) < 40_000


@pytest.mark.slow
@pytest.mark.parametrize(("method", "samples"), [(PAPER, 40_000), *nightly((None, 40_000), (None, 200_000))])
def test_ra1_as_a_run_counts_it(method, samples):
    """An event that a run still sees."""
    a = cases.ra1()
    a.measure("far", a.parts[1].point(50, 0, 10), along="z", limits=(None, 9.5))
    options = {"solver": "daqp", "method": method}
    counted = tc.summarize(tc.run(a, samples=samples, seed=5, keep="measures", fields="none", surfaces=0, **options))
    _, low, high = counted.statistic_value.sel(measure="far", state="corrected", statistic="above limit").values
    found = tc.analyses.tails(a, samples=30_000, **options)
    _, lower, upper = found.probability.sel(event="far outside limits").values
    assert lower < high and low < upper and 0 < high < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("limits", [(0.0, 4.0), (0.0, None)])
def test_a_limit_at_a_stop_hides_nothing(limits):
    """The height max(0, g), g ~ N(0, 1), is never below 0, and how seldom it is above 4 does not depend on that."""
    a = cases.one_dimensional(0)
    a.measure("kept", a.parts[1].point(5, 5, 10), along="z", limits=limits)
    found = tc.analyses.tails(a, samples=30_000, seed=2, solver="daqp", method=PAPER)
    estimate, lower, upper = found.probability.values[0]
    assert found.stop.values.tolist() == [1]
    if limits[1] is None:
        assert estimate == 0 and upper < 2e-3
    else:
        assert lower < stats.norm.sf(4) < upper < 1.5 * estimate


def test_what_has_no_rare_event_is_refused():
    with pytest.raises(tc.OptionError, match="no measurement has limits"):
        tc.analyses.tails(cases.one_dimensional(0), method=PAPER)
    with pytest.raises(tc.OptionError, match="samples is 100;"):
        tc.analyses.tails(limited(4), samples=100)
    still = tc.Assembly("still")
    part = still.part("part", tc.Box(1, 2, 3), fixed=True)
    still.measure("corner", part.point(0, 0, 0), along="x", tolerance=1)
    with pytest.raises(tc.OptionError, match="nothing varies"):
        tc.analyses.tails(still)


@pytest.mark.slow
def test_measured_parts_and_correlations_are_drawn_as_in_a_run():
    a = limited(2.5)
    a.population(pd.DataFrame({"z": np.linspace(-3, 3, 200)}), {"block.Z": "z"})
    _, lower, upper = tc.analyses.tails(a, samples=30_000, solver="daqp").probability.values[0]
    assert lower <= (np.linspace(-3, 3, 200) > 2.5).mean() <= upper


@pytest.mark.slow
def test_the_command_prints_a_table_json_and_csv(tmp_path):
    model = tmp_path / "model.py"
    text = (
        "import tolcontact as tc\n\n\ndef assembly():\n    a = tc.Assembly('m')\n    b = a.part('b', tc.Box(10, 10, 10))\n"
        "    a.locate(b, tc.three_two_one(b.face('-z'), b.face('-y'), b.face('-x')), tolerance=0.6)\n"
        "    a.measure('h', b.point(5, 5, 10), along='z', tolerance=0.4)\n    return a\n"
    )
    model.write_text(text)
    options = ("tails", model, "--samples", "30000")
    done = call(tmp_path, *options)
    assert done.returncode == 0 and "h outside limits" in done.stdout and "ppm" in done.stdout, done.stderr
    model.write_text(text.replace("0.4", "0.1"))  # what is no rare event is only counted
    said = json.loads(call(tmp_path, *options, "--json").stdout, parse_constant=pytest.fail)
    assert said["coords"]["event"]["data"] == ["h outside limits"]
    table = pd.read_csv(io.StringIO(call(tmp_path, *options, "--csv").stdout))
    assert {"event", "estimate", "lower", "upper"} <= set(table)
    assert call(tmp_path, *options, "--csv", "--json").returncode == 2
    assert call(tmp_path, "tails", model, "--samples", "10").returncode == 2
