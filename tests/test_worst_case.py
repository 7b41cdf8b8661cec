"""Worst cases: documented answers, closed forms, bounds that searches reach, and the region of what drawings allow."""

import io
import json
import math

import pandas as pd
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, call, nightly


def values(found, measure=0, state="corrected", of="worst"):
    return found[of].isel(measure=measure).sel(state=state).values


def small_ra1(**method):
    a = tc.Assembly("small", method=tc.Method(**method))
    base = a.part("base", tc.Box(100, 50, 10))
    top = a.part("top", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    for part, side in ((base, "-y"), (top, "+y")):
        scheme = tc.three_two_one(part.face("-z"), part.face(side), part.face("-x"), inset=5)
        a.locate(part, scheme, tolerance=0.02)
    a.contact("interface", moving=top.face("-z"), reference=base.face("+z"))
    a.measure("corner height", top.point(50, 0, 10), along="z")
    return a


@pytest.mark.slow
@pytest.mark.parametrize("resolution", [*nightly("linearized"), "exact"])
def test_searches_reach_the_bound_where_the_optimality_conditions_are_known(resolution):
    """Two methods that share no code: searches on the engine, and a mixed-integer program; 2e-5 mm are of second order."""
    found = tc.analyses.worst_case(small_ra1(objective="all points", resolution=resolution), samples=512, solver="daqp")
    assert values(found) == pytest.approx(values(found, of="bound"), abs=3e-5)
    assert values(found, state="raw") == pytest.approx(values(found, state="raw", of="bound"), abs=1e-5)
    assert values(found)[1] - values(found)[0] > 0.03


@pytest.mark.slow
def test_contact_alone_keeps_no_part_down():
    found = tc.analyses.worst_case(small_ra1(), samples=512, solver="daqp", method=PAPER)
    least, largest = values(found, of="bound")
    assert values(found)[0] == pytest.approx(least, abs=3e-5) and math.isinf(largest)
    assert values(found)[1] > values(found, of="random")[1] and values(found)[0] < values(found, of="random")[0]


def test_nothing_that_varies_is_refused():
    a = tc.Assembly("still")
    part = a.part("part", tc.Box(1, 2, 3), fixed=True)
    a.measure("corner", part.point(0, 0, 0), along="x")
    with pytest.raises(tc.OptionError, match="nothing varies"):
        tc.analyses.worst_case(a)
    with pytest.raises(tc.OptionError, match="samples is 1"):
        tc.analyses.worst_case(a, samples=1)


def test_measured_parts_alone_have_the_worst_of_their_rows():
    """The least square is that of a row between the others, which no direction leads to."""
    a, rows = tc.Assembly("measured"), [0.3, -0.2, 0.05, 0.1]
    block = a.part("block", tc.Box(50, 25, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0)
    a.population({f"block.A{k}": rows for k in (1, 2, 3)})
    a.measure("height", block.point(0, 0, 0), along="z")
    a.measure("square", lambda poses: poses.position(block.point(0, 0, 0))[2] ** 2, units="mm^2")
    found = tc.analyses.worst_case(a, samples=16, solver="daqp")
    assert values(found) == pytest.approx([-0.2, 0.3], abs=1e-12)
    assert values(found, measure=1) == pytest.approx([0.0025, 0.09], abs=1e-12)


@pytest.mark.slow
def test_the_command_prints_a_table_json_and_csv(tmp_path):
    options = ("worst", cases.MODELS / "clutch.py", "--samples", "16", "--solver", "daqp")
    done = call(tmp_path, *options)
    assert done.returncode == 0 and "7.93847" in done.stdout and "+0.025" in done.stdout, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 100
    said = json.loads(call(tmp_path, *options, "--json").stdout, parse_constant=pytest.fail)
    assert said["data_vars"]["worst"]["data"][0][1] == pytest.approx([5.95736, 7.93847], abs=1e-4)
    table = pd.read_csv(io.StringIO(call(tmp_path, *options, "--csv").stdout))
    assert {"measure", "state", "end", "worst", "bound", "random"} <= set(table)
    assert call(tmp_path, *options, "--csv", "--json").returncode == 2
