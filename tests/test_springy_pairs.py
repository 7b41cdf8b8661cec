"""Contact pairs that give way: a block on a layer of springs, a shaft and a ball, against closed forms and a second method."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.helpers import compiled, simulate
from tolcontact.testing import assert_gaps_recompute
from tolcontact.vocabulary import CORRECTED, Status

SEATED = tc.Method(objective="seating")
WIDTH, DEPTH, LOAD, STIFFNESS = 120.0, 60.0, 100.0, 1000.0


def padded_block(offset=(8, -3), *, unit=1.0, rotation=(0, 0, 0), points=None, stiffness=STIFFNESS):
    """A block on a pad, pressed at an offset [mm] from its middle; all lengths are multiplied by `unit`."""
    turn = Rotation.from_rotvec(rotation)
    model = tc.Assembly("padded block", method=SEATED)
    base = model.part("base", tc.Box(400 * unit, 300 * unit, 50 * unit), rotation=rotation, fixed=True)
    place = turn.apply([100 * unit, 100 * unit, 50 * unit])
    block = model.part("block", tc.Box(WIDTH * unit, DEPTH * unit, 30 * unit), at=place, rotation=rotation)
    ends = {"B1": (20 * unit, 0, 0), "B2": (100 * unit, 0, 0)}
    sides = [tc.Locator(name, end, "y", 0.2 * unit) for name, end in ends.items()]
    model.locate(block, [*sides, tc.Locator("C1", (0, 30 * unit, 0), "x", 0.2 * unit)], floating=True)
    faces = {"moving": block.face("-z"), "reference": base.face("+z")}
    model.contact("pad", **faces, stiffness=stiffness and stiffness / unit, points=points)
    pressed = block.point((WIDTH / 2 + offset[0]) * unit, (DEPTH / 2 + offset[1]) * unit, 0)
    model.force("load", at=pressed, vector=tuple(turn.apply([0, 0, -LOAD])))
    up = tuple(turn.apply([0, 0, 1]))
    for name, x, y in (("middle", WIDTH / 2, DEPTH / 2), ("end", WIDTH, DEPTH / 2), ("side", WIDTH / 2, DEPTH)):
        model.measure(name, block.point(x * unit, y * unit, 0), along=up)
    return model


def heights(model, **choices):
    """Return the corrected measures (realization, measure) of realizations that are all resolved."""
    _, run = simulate(model, **choices)
    assert (run["status"] == Status.RESOLVED).all()
    assert run["reaction"][:, 0] == pytest.approx(LOAD, rel=1e-6)
    return run["measured"][:, CORRECTED]


@pytest.mark.parametrize("solver", ["qpoases", "daqp", "graph", "osqp"])
def test_a_block_sinks_and_tilts_on_its_pad_by_the_closed_form(solver):
    """Sink F/k, tilts F e / (k b^2 / 12), while all of the pad is compressed."""
    sink, tilts = -LOAD / STIFFNESS, (12 * LOAD * 8 / (STIFFNESS * WIDTH**2), 12 * LOAD * 3 / (STIFFNESS * DEPTH**2))
    expected = [sink, sink - tilts[0] * WIDTH / 2, sink + tilts[1] * DEPTH / 2]
    samples = 3 if solver == "osqp" else 30
    assert heights(padded_block(), samples=samples, solver=solver) == pytest.approx(np.tile(expected, (samples, 1)), abs=2e-6)


@pytest.mark.parametrize("solver", ["qpoases", "daqp"])
def test_a_stiff_pad_is_a_floor(solver):
    assert np.abs(heights(padded_block((0, 0), stiffness=1e12), samples=20, solver=solver)).max() < 1e-9


def test_turned_frames_and_other_units_change_nothing():
    plain = heights(padded_block(), samples=20)
    assert heights(padded_block(rotation=(0.3, -0.5, 0.2)), samples=20) == pytest.approx(plain, abs=1e-8)
    assert heights(padded_block(unit=1e-3), samples=20) * 1e3 == pytest.approx(plain, abs=1e-7)


def test_a_block_lifts_off_its_pad_as_a_layer_without_tension_says(tmp_path):
    """Pressed near an end it carries over a length 3 (b/2 - e); also by a second method from the archived springs."""
    offset, path = 40.0, tmp_path / "pad.nc"
    tc.run(compiled(padded_block((offset, 0), points=80), solver="daqp"), samples=3, out=path)
    assert_gaps_recompute(path)
    with tc.open_archive(path) as tree:
        assert (tree["status"].values == Status.RESOLVED).all()
        contact = tree["contact"].to_dataset()
        springs, stiffness = contact["moving_point"].values, contact["point_stiffness"].values
        R, t = (tree[name].sel(part="block", state="corrected").values for name in ("rotation", "translation"))
        gaps = ((springs @ R.swapaxes(1, 2) + t[:, None]) - contact["reference_point"].values)[..., 2]
        forces = stiffness * np.maximum(-gaps, 0)
        assert forces.sum(axis=1) == pytest.approx(tree["reaction"].values[:, 0], rel=1e-6)
        assert forces.sum(axis=1) == pytest.approx(LOAD, rel=1e-6)
        heights = tree["measured"].sel(state="corrected").values
        rebuilt = tc.io.model_of(tree)
    assert (tc.summarize(path)["penetration"] == 0).all()  # what gives way does not penetrate
    assert stiffness.sum() == pytest.approx(STIFFNESS)
    assert rebuilt.pairs[0].stiffness == STIFFNESS
    places = springs - [100, 100, 50]
    sink, tilt = layer_without_tension(places[:, 0], stiffness, WIDTH / 2 + offset)
    assert heights[:, 0] == pytest.approx(-sink - tilt * WIDTH / 2, abs=2e-5)
    assert heights[:, 1] == pytest.approx(-sink - tilt * WIDTH, abs=2e-5)
    length, pressure = 3 * (WIDTH / 2 - offset), 2 * LOAD / (STIFFNESS / WIDTH * 3 * (WIDTH / 2 - offset))
    slope = pressure / length
    assert heights[:, 1] == pytest.approx(-pressure, rel=0.03)
    assert heights[:, 1] - heights[:, 0] == pytest.approx(-slope * WIDTH / 2, rel=0.03)


def layer_without_tension(x, stiffness, place):
    """Return sink and tilt of springs at x [mm] that only push, under a force at `place`, by active sets."""
    carries = np.ones(len(x), dtype=bool)
    for _ in range(100):
        k, X = stiffness[carries], np.column_stack([np.ones(carries.sum()), x[carries]])
        sink, tilt = np.linalg.solve((X * k[:, None]).T @ X, LOAD * np.array([1, place]))
        following = sink + tilt * x > 0
        if (following == carries).all():
            return sink, tilt
        carries = following
    raise AssertionError("the set of springs that carry does not settle")


def shaft_on_a_plane(**choices):
    model = tc.Assembly("shaft", method=SEATED)
    base = model.part("base", tc.Box(200, 100, 20), fixed=True)
    shaft = model.part("shaft", tc.Pin(20, 100), at=(150, 50, 30), rotation=(0, np.pi / 2, 0))
    places = {"A": ((0, 0, 0), "y"), "B": ((0, 0, -100), "y"), "C": ((0, 0, 0), "z"), "D": ((0, 10, -50), "x")}
    model.locate(shaft, [tc.Locator(name, p, n, 1e-3) for name, (p, n) in places.items()], floating=True)
    model.contact("line", moving=shaft.face(tc.select.Cylinder(radius=10)), reference=base.face("+z"), stiffness=500, **choices)
    model.force("load", at=shaft.point(0, 0, -30), vector=(0, 0, -LOAD))
    for end in (0, -100):
        model.measure(f"height at {end}", shaft.point(0, 0, end), along="z")
    return model


def test_a_shaft_sinks_into_a_plane_by_its_own_springs():
    expected = [-LOAD * 0.7 / 250, -LOAD * 0.3 / 250]
    assert heights(shaft_on_a_plane(), samples=20) == pytest.approx(np.tile(expected, (20, 1)), abs=1e-4)


def test_what_cannot_give_way_is_refused():
    with pytest.raises(tc.ModelError, match=r'contact pair "line".*stiffness.*flat faces.*leave stiffness out'):
        tc.build(shaft_on_a_plane(points=50))
    with pytest.raises(tc.ModelError, match=r'contact pair "pad": it has a stiffness.*seating.*leave stiffness out'):
        tc.build(padded_block(), method={"objective": "all points"})
    with pytest.raises(tc.ModelError, match=r"stiffness is 0\.0; expected a number in N/mm above 0"):
        tc.build(padded_block(stiffness=0.0))


def test_poses_do_not_depend_on_blocks():
    _, whole = simulate(padded_block(), samples=40, solver="graph")
    _, single = simulate(padded_block(), samples=40, solver="graph", block=1)
    assert np.array_equal(whole["poses"], single["poses"])


def test_a_pressed_pad_is_not_in_conflict():
    """A block that is too long for two walls, pressed on a pad."""
    model = padded_block()
    (block,) = (part for part in model.parts if part.name == "block")
    for name, x, own, facing in (("left", 50, "-x", "+x"), ("right", 219.9, "+x", "-x")):
        wall = model.part(name, tc.Box(50, 300, 50), at=(x, 0, 50), fixed=True)
        model.contact(name, moving=block.face(own), reference=wall.face(facing))
    results = tc.run(compiled(model, solver="daqp"), samples=5)
    assert (results["status"] == Status.NOT_ASSEMBLABLE).any()
    conflicts = dict(zip(results["pair"].values.tolist(), tc.summarize(results)["conflicts"].values.tolist(), strict=True))
    assert conflicts["pad"] == 0 and conflicts["left"] > 0 and conflicts["right"] > 0


def test_a_point_that_stands_for_no_area_does_not_spoil_its_pair():
    """Of 118 points of a flange one stands for none: its spring is a thousandth of the mean, and realizations converge."""
    model = tc.Assembly("flange", method=tc.Method(objective="seating"))
    front, rear = (
        model.part("front", tc.Box(300, 200, 1), fixed=True),
        model.part("rear", tc.Box(300, 200, 1.5), at=(250, 0, 1)),
    )
    scheme = tc.three_two_one(rear.face("-z"), rear.face("-y"), rear.face("-x"), inset=5)
    model.locate(rear, scheme, tolerance=0.1)
    model.contact("flange", moving=rear.face("-z"), reference=front.face("+z"), points=600, within=2, stiffness=1e5)
    model.force("press", at=rear.point(25, 100, 1.5), vector=(0, 0, -10))
    model.measure("end", rear.point(300, 100, 0), along="z", tolerance=1)
    program, run = simulate(model, samples=3, solver="daqp")
    (pair,) = (pair for pair in program.nominal.pairs if pair.name == "flange")
    assert pair.weights.min() == 0
    assert pair.stiffness.min() > 0
    assert pair.stiffness.sum() == pytest.approx(1e5)
    assert (run["status"] == Status.RESOLVED).all()
