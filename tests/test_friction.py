"""Critical friction: closed forms are in the benchmark suite; here frames, a brute force, declarations, and what is said."""

import json

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from studies.benchmarks.friction import is_held
from studies.benchmarks.problems import friction_on_an_incline as incline
from tests import cases
from tests.cases.frames import STILL
from tests.cases.measured import ring, shaft
from tests.helpers import nightly

PADS = np.array([(10, 10, 0), (90, 15, 0), (45, 50, 0)], dtype=float)
STOPS = {"left": ((0, 20, 12), (1, 0, 0)), "front": ((60, 0, 8), (0, 1, 0))}
CLAMP_AT = np.array([55.0, 30.0, 20.0])


def seat(clamp, frame=STILL, newtons=1.0, **options):
    """A block on a table that ends at three points, with two stops, under a clamp (3,) and its weight."""
    s = frame.scale
    a = tc.Assembly("seat", **options)
    table = trimesh.convex.convex_hull(np.vstack([PADS, PADS - (0, 0, 10)]) * s)
    base = a.part("table", tc.Mesh(table), **frame.place(0, 0, 0), fixed=True)
    block = a.part("block", frame.box(100, 60, 20), **frame.place(0, 0, 0))
    stops = [tc.Locator(name, s * np.array(at), into, 0.1 * s, one_sided=True) for name, (at, into) in STOPS.items()]
    a.locate(block, stops, floating=True)
    a.contact("pads", moving=block.face("-z"), reference=base.face(lambda c, n: (n @ np.array([0, 0, 1.0])) > 0.9))
    a.force("weight", at=block.point(*(s * np.array([50, 30, 10]))), vector=newtons * np.array(frame.along(0, 0, -10)))
    a.force("clamp", at=block.point(*(s * CLAMP_AT)), vector=newtons * np.array(frame.along(*clamp)))
    a.measure("x", block.point(0, 0, 0), along=frame.along(1, 0, 0))
    return a


def critical(model):
    return tc.analyses.seating(model).critical.to_series()


@pytest.mark.parametrize("clamp", [(-12, -5, -30), *nightly(((-4, -9, -15),))])
def test_a_seat_agrees_with_a_brute_force_over_directions_of_friction(clamp):
    found = critical(seat(clamp))
    for name in STOPS:
        others = [(at, into) for other, (at, into) in STOPS.items() if other != name]
        loads = [((50, 30, 10), (0, 0, -10)), (CLAMP_AT, clamp)]
        contacts = [*((pad, (0, 0, 1)) for pad in PADS), *others]
        least = found[f"block.{name}"]
        assert is_held(contacts, loads, least * (1 + 1e-5)) and not is_held(contacts, loads, least * (1 - 1e-5))


def test_turned_frames_and_other_units_change_nothing():
    expected = critical(seat((-12, -5, -30)))
    for frame, newtons in ((cases.Frame(turn=(2, 1, -1), shift=(-900, 300, 800)), 1.0), (cases.Frame(scale=25.4), 1e-3)):
        np.testing.assert_allclose(critical(seat((-12, -5, -30), frame, newtons)), expected, atol=1e-7)


def with_friction(model, mu, **pairs):
    """A copy of a model that states friction, of all contacts and of pairs by name."""
    copy = tc.Assembly(model.name, mu=mu).replaced(
        parts=model.parts, locations=model.locations, forces=model.forces, measures=model.measures
    )
    for pair in model.pairs:
        copy.contact(pair.name, moving=pair.moving, reference=pair.reference, mu=pairs.get(pair.name))
    return copy


def test_stated_friction_is_compared_and_warned_of():
    with pytest.warns(tc.NominalWarning, match=r'\[friction\] seat "block.stop".*0\.91 of the stated.*at "plane"'):
        result = tc.analyses.seating(with_friction(incline.assembly(), 0.4)).sel(seat="block.stop")
    assert float(result.reserve) == pytest.approx(np.tan(np.radians(20)) / 0.4, abs=1e-6)
    assert float(result.share.sel(holder="plane")) == pytest.approx(1)


def test_a_pair_without_friction_holds_nothing(recwarn):
    smooth = tc.analyses.seating(with_friction(incline.assembly(), 0.3, plane=0.0)).sel(seat="block.stop")
    assert np.isinf([smooth.critical, smooth.reserve]).all()
    assert float(tc.analyses.seating(with_friction(incline.assembly(), 0.3)).reserve.sel(seat="block.stop")) > 1
    assert not [warning for warning in recwarn if "[friction]" in str(warning.message)]


def test_contacts_that_press_against_each_other_hold_along_themselves_but_not_about_their_line():
    def pinched(off):
        a = tc.Assembly("pinched")
        block = a.part("block", tc.Box(20, 20, 20))
        jaws = [
            tc.Locator(f"jaw {k}", (x, 10, 10), into, 0, one_sided=True) for k, (x, into) in enumerate([(0, "x"), (20, "-x")])
        ]
        pads = [(10, 0, 0), (0, 20, 0), (20, 20, 0)]
        rest = [tc.Locator(f"rest {k}", pad, "z", 0, one_sided=True) for k, pad in enumerate(pads)]
        sides = [tc.Locator(f"side {x}", (x, 0, 10), "y", 0) for x in (0, 20)]
        a.locate(block, [*jaws, *rest, *sides])
        a.force("push", at=block.point(10, 10 + off, 20), vector=(0, 0, -10))
        a.measure("z", block.point(0, 0, 0), along="z")
        return critical(a)

    assert pinched(0)["block.rest 0"] == pytest.approx(0, abs=1e-3)
    # The other rests, 10 mm beside the line of the jaws and 10 mm below it, balance a moment about it from 10 / 10 on.
    assert pinched(-9)["block.rest 0"] == pytest.approx(1, abs=1e-4)


def test_a_pin_in_a_wider_bore_lies_at_its_bottom():
    a = tc.Assembly("pin")
    bore = a.part("ring", ring(), fixed=True)
    pin = a.part("pin", shaft())
    a.locate(pin, [tc.Locator("shoulder", (0, 0, -15), "z", 0.1, one_sided=True)], floating=True)
    a.contact("bore", moving=pin.face(tc.select.Cylinder()), reference=bore.face(tc.select.Cylinder(inner=True)))
    a.force("weight", at=pin.point(0, 0, 0), vector=(1.2, -1.6, 0))
    a.force("push", at=pin.point(0, 0, 0), vector=(0, 0, -0.6))
    a.measure("end", pin.point(0, 0, 15), along="z")
    result = tc.analyses.seating(a).sel(seat="pin.shoulder")
    assert float(result.critical) == pytest.approx(0.6 / 2, abs=1e-6)
    assert float(result.share.sel(holder="bore")) == pytest.approx(1) and not result.attrs["open_pairs"]


def test_friction_is_part_of_a_json_model(tmp_path):
    tc.io.write_model(with_friction(incline.assembly(), 0.3, plane=0.0), tmp_path / "model.json")
    document = json.loads((tmp_path / "model.json").read_text())
    assert document["mu"] == 0.3 and document["pairs"][0]["mu"] == 0
    assert tc.build(tmp_path / "model.json").nominal.assembly.pairs[0].mu == 0


@pytest.mark.parametrize("mu", [-0.1, "rough", True, float("nan"), 11])
def test_friction_that_is_no_coefficient_is_refused(mu):
    for model in (with_friction(incline.assembly(), mu), with_friction(incline.assembly(), None, plane=mu)):
        assert any("expected a coefficient of friction from 0 to 10" in fault for fault in tc.check(model))


def test_what_cannot_be_asked_is_refused():
    with pytest.raises(tc.OptionError, match="has no forces, so nothing presses"):
        tc.analyses.seating(cases.ra1())
    with pytest.raises(tc.OptionError, match='nothing that touches holds "block" against the forces, even'):
        tc.analyses.seating(seat((0, 0, 300)))


def pushed_blocks(pushes, joined=False):
    """A block that a force pushes towards a stop over a floor; with stations in each of them, alone or in a joint."""
    line = tc.Assembly("pushed")
    floor = line.part("floor", tc.Box(400, 200, 10), at=(-100, -50, -10), fixed=True)
    block = line.part("block", tc.Box(100, 50, 20))
    cover = line.part("cover", tc.Box(100, 50, 20), at=(0, 0, 20)) if joined else block
    body = block
    if joined:
        weld = line.station("weld")
        for part in (block, cover):
            weld.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x")), tolerance=0.1)
        body = weld.join("stack", block, cover)
    for name, push in pushes.items():
        station = line.station(name)
        stop = tc.Locator("stop", cover.point(0, 25, 5), "x", 0.1, one_sided=True)
        sides = [tc.Locator(f"side {x}", block.point(x, 0, 5), "y", 0.1) for x in (10, 90)]
        station.locate(body, [stop, *sides], floating=True)
        station.contact(f"floor of {name}", moving=block.face("-z"), reference=floor.face("+z"))
        station.force(f"push of {name}", at=cover.point(50, 25, 0), vector=(-push, 0, -10))
        station.measure(f"x in {name}", block.point(0, 0, 0), along="x")
    return line


@pytest.mark.parametrize("joined", [True, *nightly(False)])
def test_each_station_has_seats_with_its_own_forces(joined):
    found = critical(pushed_blocks({"first": 3.0, "second": 7.0}, joined))
    body = "stack" if joined else "block"
    assert found[f"first.{body}.stop"] == pytest.approx(0.3, abs=1e-5)
    assert found[f"second.{body}.stop"] == pytest.approx(0.7, abs=1e-5)
