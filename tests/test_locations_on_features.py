"""Parts that are located on a feature of another part follow its deviations."""

import json

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.cases import STILL, Frame
from tests.helpers import compiled, nightly
from tolcontact.testing import assert_gaps_recompute, assert_same_run

TILT = 5e-5  # [mm] of second order: 5 mm times the square of a tilt of 0.003


def pin_in_a_ring(frame: Frame = STILL) -> tc.Assembly:
    """A pin in the bore of a ring, and a cap on supports on top of the ring."""
    a = tc.Assembly("pressed")
    ring = a.part("ring", tc.Mesh(trimesh.creation.annulus(5, 20, 10)), **frame.place(0, 0, 0), fixed=True)
    ring.feature("under", ring.face("-z"), datum="A")
    ring.feature("rim", ring.face(tc.select.Cylinder(radius=20)), datum="B")
    top = ring.feature("top", ring.face("+z"), tc.Profile(0.1, "A"))
    bore = ring.feature("bore", ring.face(tc.select.Cylinder(inner=True)), tc.Size(10, 0.1), tc.Position(0.1, "A|B"))
    pin = a.part("pin", tc.Mesh(trimesh.creation.cylinder(5, 20)), **frame.place(0, 0, 5))
    sides = [tc.Locator(f"{axis}{z}", (0, 0, z), axis, 0.0) for z in (-10, 0) for axis in "xy"]
    a.locate(pin, [*sides, tc.Locator("end", (0, 0, -10), "z", 0.0), tc.Locator("turn", (5, 0, -5), "y", 0.0)], on=bore)
    cap = a.part("cap", tc.Box(4, 4, 1), **frame.place(8, 0, 5))
    feet = [
        tc.Locator(f"Z{k}", (x, y, 0), "z", 0.0, one_sided=True) for k, (x, y) in enumerate([(0, 0), (4, 0), (0, 4), (4, 4)])
    ]
    rows = [tc.Locator("X", (0, 0, 0), "x", 0.0), tc.Locator("Y1", (0, 0, 0), "y", 0.0), tc.Locator("Y2", (4, 0, 0), "y", 0.0)]
    a.locate(cap, [*feet, *rows], on=top)
    for end in (0, 1):
        for k, axis in enumerate("xy"):
            along = frame.along(*np.eye(3)[k])
            a.measure(f"pin {axis}{end}", pin.point(0, 0, 10 * end - 10), along=along)
            a.measure(f"bore {axis}{end}", bore.axis(end), along=along)
    a.measure("cap", cap.point(4, 0, 0), along=frame.along(0, 0, 1))
    a.measure("top", top.point(12, 0, 5), along=frame.along(0, 0, 1))
    return a


@pytest.mark.parametrize("frame", [Frame(turn=(0, 0, 2.0), shift=(100, -50, 7)), *nightly(STILL)], ids=["moved", "still"])
def test_a_pin_follows_the_axis_of_its_bore_and_a_cap_its_ground(frame):
    results = tc.run(compiled(pin_in_a_ring(frame)), samples=60, keep="all")
    measured = results.measured.sel(state="corrected")
    for end in (0, 1):
        for axis in "xy":
            pin, bore = (measured.sel(measure=f"{name} {axis}{end}").values for name in ("pin", "bore"))
            assert np.abs(pin - bore).max() < TILT < 0.1 * bore.std()
    assert np.abs(measured.sel(measure="cap") - measured.sel(measure="top")).max() < TILT
    assert_gaps_recompute(results)
    again = tc.io.model_of(results)
    assert str(again.locations[0]) == "location of pin on bore of ring: 6 locators"
    assert_same_run(results, tc.run(again, samples=60, keep="all"))


def test_a_json_model_names_the_feature_that_a_part_is_on(tmp_path):
    a = tc.Assembly("stack")
    foot = a.part("foot", tc.Box(20, 20, 5), fixed=True)
    foot.feature("under", foot.face("-z"), datum="A")
    top = foot.feature("top", foot.face("+z"), tc.Profile(0.1, "A"))
    block = a.part("block", tc.Box(20, 20, 5), at=(0, 0, 5))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0.0, on=top)
    a.measure("step", top.point(20, 0, 5), to=block.point(20, 0, 0), along="z", absolute=False)
    assert np.abs(tc.run(compiled(a), samples=20).measured).max() < TILT
    path = tmp_path / "stack.json"
    tc.io.write_model(a, path)
    document = json.loads(path.read_text())
    assert document["locations"][0]["on"] == "foot" and document["locations"][0]["on_feature"] == "top"
    assert np.abs(tc.run(path, samples=20).measured).max() < TILT
    for on, feature, reason in ((None, "top", 'it goes with "on"'), ("foot", "lid", 'the name of a feature of part "foot"')):
        document["locations"][0] |= {"on": on, "on_feature": feature}
        path.write_text(json.dumps(document))
        with pytest.raises(tc.TolcontactError, match=rf"locations\[0\]\.on_feature: .*{reason}"):
            tc.run(path, samples=20)


def test_a_feature_that_its_part_does_not_have_is_named():
    a = pin_in_a_ring()
    stray = tc.declaration.Feature("stray", a.parts[0], (a.parts[0].face("+z"),))
    a.locate(a.parts[1], [], floating=True, on=stray)
    assert any('it is on feature "stray", which is no feature of part "ring"' in fault for fault in tc.check(a))
    with pytest.raises(TypeError, match='locate "pin": on is a Face; expected a part, a feature of it, or None'):
        a.locate(a.parts[1], [], on=a.parts[0].face("+z"))
