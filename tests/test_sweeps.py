"""Mechanisms swept through their positions: envelopes against closed forms, from the same draws everywhere."""

import io
import json

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import tolcontact as tc
from tests.helpers import call

LENGTH, WIDTH = 100.0, 0.6
ANGLES = [0.0, np.pi / 6, np.pi / 3]
SCRIPT = """
import tolcontact as tc


def assembly(angle=0.0):
    a = tc.Assembly("arm")
    arm = a.part("arm", tc.Box(100, 10, 10), rotation=(0, 0, angle))
    feet = tc.three_two_one(arm.face("-z"), arm.face("-y"), arm.face("-x"), inset=2)
    a.locate(arm, feet, tolerance=0)
    tip = arm.feature("tip", arm.face("+x"), arm.face("-x"), tc.Size(100, 0.3, -0.3, moves="first"))
    a.measure("reach", tip.point(100, 0, 5), along="x", absolute=True, limits=(49.9, 100.2))
    return a
"""


def arm(angle=0.0):
    names = {}
    exec(SCRIPT, names)
    return names["assembly"](angle)


def cam(place=0.0):
    """A follower that its weight presses on one of two pads, whose heights vary: place 0 or 1."""
    a = tc.Assembly("cam", method=tc.Method(objective="seating"))
    tops = []
    for k in range(2):
        pad = a.part(f"pad {k}", tc.Box(40, 40, 10), at=(60 * k, 0, -10), fixed=True)
        pad.feature("under", pad.face("-z"), datum="A")
        tops.append(pad.feature("top", pad.face("+z"), tc.Profile(WIDTH, "A", rule="translation")))
    follower = a.part("follower", tc.Box(20, 20, 10), at=(10 + 60 * place, 10, 0))
    sides = {"B1": ((0, 0, 5), "y"), "B2": ((20, 0, 5), "y"), "C": ((0, 10, 5), "x")}
    a.locate(follower, [tc.Locator(name, point, along, 0) for name, (point, along) in sides.items()], floating=True)
    a.contact("ride", moving=follower.face("-z"), reference=tops[round(place)], points=4)
    a.force("weight", at=follower.point(10, 10, 5), vector=(0, 0, -5))
    a.measure("lift", follower.point(10, 10, 0), along="z", limits=(None, 0.25))
    return a


def test_the_reach_of_an_arm_has_the_envelope_of_its_length():
    """It is length times cosine: least at 60 degrees, largest at 0, with the spread times the cosine."""
    found = tc.analyses.sweep(arm, {"angle": ANGLES}, samples=400, seed=2)
    length = LENGTH + (found["swept"].isel(position=0, state=0, measure=0).values - LENGTH)
    for state in ("raw", "corrected"):
        values = found["swept"].sel(state=state, measure="reach")
        assert values.values == pytest.approx(np.outer(np.cos(ANGLES), length), abs=1e-9)
        least, largest = found["envelope"].sel(measure="reach", state=state)
        for end, angle in ((least, ANGLES[-1]), (largest, 0.0)):
            assert end.sel(of_envelope="mean").values[0] == pytest.approx(length.mean() * np.cos(angle))
            lower, upper = end.sel(of_envelope="6 sigma").values[1:]
            assert lower < 0.6 * np.cos(angle) < upper
    share = found["extreme_share"].sel(state="raw", measure="reach").values
    assert share.tolist() == [[0, 0, 1], [1, 0, 0]]
    outside = (length > 100.2) | (length * np.cos(ANGLES[-1]) < 49.9)
    assert found["outside"].sel(state="raw").values[0, 0] == pytest.approx(outside.mean()) and 0 < outside.mean() < 0.2
    mean = found["mean"].sel(measure="reach", state="raw", interval="estimate").values
    assert mean == pytest.approx(length.mean() * np.cos(ANGLES))


def test_a_follower_has_the_larger_of_the_heights_that_it_rides_on():
    """The mean of the larger of two normal numbers is sigma / sqrt(pi), and both pads decide equally often."""
    found = tc.analyses.sweep(cam, {"place": [0, 1]}, samples=800).sel(measure="lift", state="corrected")
    sigma = found["swept"].values.std()
    for end, sign in (("least", -1), ("largest", 1)):
        _, lower, upper = found["envelope"].sel(end=end, of_envelope="mean").values
        assert lower < sign * WIDTH / 6 / np.sqrt(np.pi) < upper, sigma
    assert np.abs(found["extreme_share"].values - 0.5).max() < 0.08
    heights = found["swept"].values
    assert abs(np.corrcoef(heights)[0, 1]) < 0.15
    assert found["outside"].values[0] == pytest.approx((heights.max(axis=0) > 0.25).mean())
    exact = 1 - stats.norm(0, WIDTH / 6).cdf(0.25) ** 2
    assert found["outside"].values[1] < exact < found["outside"].values[2]


def test_a_script_is_swept_by_the_command_line(tmp_path):
    (tmp_path / "arm.py").write_text(SCRIPT)
    done = call(tmp_path, "sweep", "arm.py", "--over", "angle=0:1:3", "--samples", 200, "--quiet")
    assert all(text in done.stdout for text in ("200 realizations at 3 positions", "angle 1 (100 %)", "beyond limits")), done
    data = json.loads(call(tmp_path, "sweep", "arm.py", "--over", "angle=0,0.5,1", "--samples", 200, "--json").stdout)
    assert data["dims"]["position"] == 3
    done = call(tmp_path, "sweep", "arm.py", "--over", "angle=0,0.5,1", "--samples", 200, "--csv", "--quiet")
    rows = pd.read_csv(io.StringIO(done.stdout)).groupby(["measure", "state"])
    shares = rows[["outside estimate", "outside lower", "outside upper"]].first()
    assert np.allclose(shares.values, data["data_vars"]["outside"]["data"][0]) and rows.size().tolist() == [6, 6]
    failed = call(tmp_path, "sweep", "arm.py", "--over", "angel=0,1", "--samples", 20)
    assert failed.returncode == 2 and ": assembly(angle) got an unexpected keyword argument 'angel'" in failed.stderr
    failed = call(tmp_path, "sweep", "arm.py", "--over", "angle=0,1", "--over", "angle=2,3", "--samples", 20)
    assert failed.returncode == 2 and '--over has "angle" 2 times; give all its values at once' in failed.stderr
    failed = call(tmp_path, "sweep", "arm.py", "--over", "angle=fast", "--samples", 20)
    assert failed.returncode == 2 and "expected --over angle=0:1.5:7 (from, to, number)" in failed.stderr
    failed = call(tmp_path, "sweep", "arm.py", "--over", "angle=0:1:1000000000", "--samples", 20)
    assert failed.returncode == 2 and '--over is "angle=0:1:1000000000"; expected at most 1000 positions' in failed.stderr


def test_whole_numbers_reach_the_script_as_such(tmp_path):
    (tmp_path / "stairs.py").write_text(
        "import tolcontact as tc\n\n\n"
        "def assembly(steps: int, rise=0.1):\n"
        '    stairs = tc.Stack("stairs")\n'
        '    stairs.link("steps", sum(rise + 1 for _ in range(steps)), 0.1)\n'
        '    stairs.gap("height")\n'
        "    return stairs\n"
    )
    for steps in ("1,2,3", "1:3:3"):
        options = ("--over", f"steps={steps}", "--over", "rise=0:1:3", "--samples", 20, "--json", "--quiet")
        done = call(tmp_path, "sweep", "stairs.py", *options)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["data_vars"]["parameter"]["data"] == [[1, 2, 3], [0, 0.5, 1]]


def test_the_help_of_a_sweep_says_that_it_takes_a_script(tmp_path):
    assert "MODEL.py" in (said := call(tmp_path, "sweep", "--help").stdout) and "RUN.nc" not in said


@pytest.mark.parametrize(
    ("model", "over", "message"),
    [
        (arm, {"angle": [0.0]}, "over has values: 1 of angle; expected two or more"),
        (arm, {"angle": [0, 1], "slide": [0]}, "2 of angle, 1 of slide; expected two or more, up to 1000, and equally many"),
        (arm, {"angle": range(1001)}, "1001 of angle; expected two or more, up to 1000"),
        (arm, {"angle": [0, 10**400]}, "expected values of each parameter"),
        (arm, {"angel": [0, 1]}, r"over does not fit the model: arm\(angle\) got an unexpected keyword argument 'angel'"),
        (arm, {"angle": ["fast", 1]}, "expected values of each parameter"),
        (arm(), {"angle": [0, 1]}, "the model is a Assembly; expected a function of angle"),
        ("arm.nc", {"angle": [0, 1]}, "holds the model at one position"),
    ],
)
def test_what_cannot_be_swept_is_refused(model, over, message):
    with pytest.raises(tc.OptionError, match=message):
        tc.analyses.sweep(model, over, samples=10)


def test_positions_with_other_contributors_are_refused():
    def other(angle):
        model = arm(angle)
        model.variable("play", 0.1, nominal=0.0) if angle else None
        return model

    def in_other_units(angle):
        model = arm(angle)
        model.measure("tip", model.parts[0].point(0, 0, 0), along="x", units="in" if angle else "mm")
        return model

    with pytest.raises(tc.OptionError, match=r"at angle=1 the contributors are others .*, such as play"):
        tc.analyses.sweep(other, {"angle": [0, 1]}, samples=10)
    with pytest.raises(tc.OptionError, match=r"at angle=1 the measurements are others .*, such as tip \[in\]"):
        tc.analyses.sweep(in_other_units, {"angle": [0, 1]}, samples=10)


def test_a_mechanism_that_cannot_be_assembled_at_a_position_is_outside_there():
    """A key of 10 mm in a slot of 10.1 and 9.9 mm: at the second place none fits, so that no envelope with contact is left."""

    def key(place):
        a = tc.Assembly("key", method=tc.Method(resolution="exact"))
        b = a.part("key", tc.Box(10, 20, 10), fixed=False)
        walls = [
            a.part(name, tc.Box(10, 20, 10), at=(x, 0, 0), fixed=True)
            for name, x in (("left", -10), ("right", 10.1 - 0.2 * place))
        ]
        feet = {"Z1": ((2, 2, 0), "z"), "Z2": ((8, 2, 0), "z"), "Z3": ((5, 18, 0), "z"), "Y": ((5, 0, 5), "y")}
        a.locate(b, [tc.Locator(name, p, along, 0) for name, (p, along) in feet.items()], floating=True)
        a.contact("a", moving=b.face("-x"), reference=walls[0].face("+x"), points=4)
        a.contact("b", moving=b.face("+x"), reference=walls[1].face("-x"), points=4)
        a.variable("lift", 0.1, drives={"key.Z1": 1, "key.Z2": 1, "key.Z3": 1})
        a.measure("lift", b.point(5, 10, 0), along="z", limits=(-1, 1))
        return a

    found = tc.analyses.sweep(key, {"place": [0, 1]}, samples=20).sel(measure="lift", state="corrected")
    assert found["outside"].values[0] == 1 and np.isnan(found["envelope"]).all()
    assert np.isfinite(found["mean"].isel(position=0)).all() and np.isnan(found["mean"].isel(position=1)).all()
