"""Parts that float: contact decides what their locators leave open, and statuses say where nothing does."""

import numpy as np
import pytest
from scipy.optimize import linprog, minimize
from scipy.stats import binom

import tolcontact as tc
from tests.cases import Frame, floating
from tests.helpers import compiled, nightly, realizations
from tolcontact.errors import ModelError
from tolcontact.testing import assert_gaps_recompute, assert_resolved
from tolcontact.vocabulary import Status

MOVED = Frame(turn=(0.3, -0.7, 1.1), shift=(1000, -500, 200))
PLACES = np.array([(x, y) for x in (-30, 30) for y in (-30, 30)], dtype=float)


def drawn(results, label):
    return results["sample"].deviation.sel(contributor=label).values


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["daqp", *nightly("qpoases")])
@pytest.mark.parametrize("frame", [*nightly(None), MOVED], ids=["still", "moved"])
@pytest.mark.parametrize("sections", [24, *nightly(90)])
def test_a_shaft_in_a_v_comes_to_where_its_diameter_and_the_walls_say(frame, solver, sections):
    results = tc.run(compiled(floating.floating_shaft_in_a_v(sections, frame=frame), solver=solver), samples=300)
    assert_resolved(results)
    assert_gaps_recompute(results)
    of = [drawn(results, label) for label in ("left.wall.offset", "right.wall.offset", "shaft.barrel.size")]
    height = results.measured.sel(state="corrected", measure="height").values
    assert np.abs(height - sum(of) / np.sqrt(2)).max() < 1e-9
    assert np.abs(results.measured.sel(state="raw", measure="height").values).max() < 1e-9  # the nominal place


@pytest.mark.slow
def test_a_peg_is_pushed_to_the_side_of_its_hole():
    results = tc.run(compiled(floating.floating_peg_in_a_hole(), solver="daqp"), samples=1000)
    assert_resolved(results)
    assert_gaps_recompute(results)
    measured = results.measured.sel(state="corrected")
    room = (0.1 + drawn(results, "plate.bore.size") - drawn(results, "peg.barrel.size")) / 2
    for axis, share in (("x", 1 / np.sqrt(5)), ("y", -2 / np.sqrt(5))):
        # What forces press yields by 0.1 % of travel / size (see seating).
        assert np.abs(measured.sel(measure=f"{axis} to bore").values - share * room).max() < 2e-6
        bore = drawn(results, f"plate.bore.shift {axis}")
        assert np.abs(measured.sel(measure=f"bore {axis}").values - bore).max() < 1e-12


@pytest.mark.slow
def test_a_hinge_pin_tilts_between_its_knuckles():
    reach, width = 40.0, 8.0
    results = tc.run(compiled(floating.hinge(reach=reach, width=width), solver="daqp"), samples=300)
    assert_resolved(results)
    assert_gaps_recompute(results)
    pin, along = drawn(results, "pin.barrel.size"), drawn(results, "pin.end")
    lift = results.measured.sel(state="corrected", measure="lift").values
    edges = [(side * reach + end * width / 2, name) for side, name in ((-1, "low"), (1, "high")) for end in (-1, 1)]
    for k in range(len(lift)):
        room = [(0.1 + drawn(results, f"{name}.bore.size")[k] - pin[k]) / 2 for _, name in edges]
        rows = [[1, z - along[k]] for z, _ in edges]  # the line y + slope (z - where the force acts) stays below every edge
        best = -linprog([-1, 0], rows, room, bounds=[(None, None)] * 2).fun
        assert lift[k] == pytest.approx(best, abs=1e-6)


@pytest.mark.slow
def test_a_lid_finds_its_place_over_four_studs():
    results = realizations(compiled(floating.lid_on_studs(position=0.1, clearance=0.3), solver="daqp"), samples=150)
    assert_resolved(results)
    x = results.measured.sel(state="corrected", measure="x").values
    holes, studs, room = floating.drawn_of_lid(results)
    checked = 0
    for k in range(len(x)):
        room_here = room[k] + 0.15
        best = minimize(
            lambda q: -q[0], first_guess(holes[k] - studs[k], room_here), method="SLSQP", options={"ftol": 1e-14},
            constraints={"type": "ineq", "fun": lambda q, k=k, room=room_here: room_left(q, holes[k], studs[k], room)},
        )  # fmt: skip
        if room_left(best.x, holes[k], studs[k], room_here).min() > -1e-9:
            assert x[k] >= best.x[0] - 1e-6  # ours is never worse
        if best.success:
            assert x[k] == pytest.approx(best.x[0], abs=1e-6)
            checked += 1
    assert checked > 0.4 * len(x)


def room_left(q, holes, studs, room):
    """How far each stud may still move in its hole (4,), for a lid that is shifted and turned by q (3,)."""
    turn = np.array([[np.cos(q[2]), -np.sin(q[2])], [np.sin(q[2]), np.cos(q[2])]])
    return room - np.linalg.norm(q[:2] + (PLACES + holes) @ turn.T - (PLACES + studs), axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("material", [*nightly(""), "M"])
def test_the_share_that_cannot_be_assembled_is_that_of_an_independent_computation(material):
    """Two hole patterns, position at maximum material or without: the least of the largest misfits, by shifting and turning."""
    words = {"material": "M"} if material else {}
    model = floating.lid_on_studs(position=0.35, sizes=0.15, clearance=0.25, seating=False, **words)
    results = realizations(compiled(model, solver="daqp"), samples=120)
    status = results.status.values
    assert np.isin(status, [Status.UNTOUCHED, Status.RESOLVED, Status.NOT_ASSEMBLABLE]).all()
    holes, studs, room = floating.drawn_of_lid(results)
    fits = np.array([most_room(*each) for each in zip(holes, studs, room + 0.125, strict=True)])
    sure = np.abs(fits) > 5e-5  # what straight sides leave of a circle
    assert sure.mean() > 0.99
    assert ((status == Status.NOT_ASSEMBLABLE)[sure] == (fits < 0)[sure]).all()
    low, high = binom.interval(0.9999, len(status), (fits < 0).mean())
    assert 0 < low <= (status == Status.NOT_ASSEMBLABLE).sum() <= high


def polygons(off, room) -> tuple[np.ndarray, np.ndarray]:
    """Rows (row, 3) and bounds (row,) that keep a lid, shifted and turned a little, in its rooms, seen in 240 directions."""
    ways = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    n = np.column_stack([np.cos(ways), np.sin(ways)])
    arms = np.column_stack([-PLACES[:, 1], PLACES[:, 0]])
    rows = np.vstack([np.column_stack([n, n @ arm]) for arm in arms])
    return rows, np.concatenate([r - n @ each for each, r in zip(off, room, strict=True)])


def first_guess(off, room) -> np.ndarray:
    """Where a lid comes to that is pushed along x, to first order."""
    return linprog([-1, 0, 0], *polygons(off, room), bounds=[(None, None)] * 3).x


def most_room(holes, studs, room) -> float:
    """The largest room [mm] that all studs can have at once, to first order: a linear program in shift, turn, and room."""
    rows, bounds = polygons(holes - studs, room)
    found = linprog([0, 0, 0, -1], np.column_stack([rows, np.ones(len(rows))]), bounds, bounds=[(None, None)] * 4)
    return float(-found.fun)


@pytest.mark.slow
def test_a_part_that_nothing_holds_is_not_certified():
    a = floating.floating_peg_in_a_hole()
    a.force("pull out", at=a.parts[1].point(0, 0, 0), vector=(0, 0, 0.001))
    held = realizations(compiled(a), samples=20)
    assert_resolved(held)  # along z it is held both ways
    loose = tc.Assembly("loose", method=floating.SEATED)
    table = loose.part("table", tc.Box(50, 50, 5), fixed=True)
    block = loose.part("block", tc.Box(10, 10, 5), at=(20, 20, 5))
    loose.locate(block, [], floating=True)
    loose.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
    loose.force("lift", at=block.point(5, 5, 2), vector=(0, 0, 1))
    loose.measure("z", block.point(0, 0, 0), along="z")
    results = tc.run(loose, samples=5)
    assert (results.status == Status.NOT_CONVERGED).all()
    still = realizations(compiled(loose, method=tc.Method(resolution="exact")), samples=5)
    assert (still.status == Status.UNTOUCHED).all() and np.abs(still.measured).max() == 0


@pytest.mark.slow
def test_locators_of_a_floating_part_move_it_as_little_as_they_can():
    """One of them shifts it, two turn it, in every frame alike; what is open stays nominal."""
    for frame in (floating.STILL, MOVED):
        a = tc.Assembly("open")
        table = a.part("table", tc.Box(200, 200, 5), **frame.place(-50, -50, -6), fixed=True)
        block = a.part("block", tc.Box(40, 20, 10), **frame.place(0, 0, 0))
        a.locate(block, [tc.Locator("Z", (20, 10, 0), "z", 0.6), tc.Locator("X", (0, 10, 5), "x", 0.6)], floating=True)
        a.contact("seat", moving=block.face("-z"), reference=table.face("+z"), within=5)
        for axis, along in (("x", (1, 0, 0)), ("y", (0, 1, 0)), ("z", (0, 0, 1))):
            a.measure(axis, block.point(33, 4, 5), along=frame.along(*along))
        results = realizations(compiled(a), samples=50)
        x, y, z = results.measured.sel(state="raw").values.T
        assert np.abs(x - drawn(results, "block.X")).max() < 1e-9 and np.abs(y).max() < 1e-9
        assert np.abs(z - drawn(results, "block.Z")).max() < 1e-9


@pytest.mark.parametrize(
    ("locators", "said"),
    [
        (
            [("a", (0, 0, 0), "z"), ("b", (5, 5, 0), "z"), ("c", (5, 5, 0), "z")],
            "over-constrained: locators block.b, block.c hold the same",
        ),
        ([("x", (0, 0, 0), "x"), ("y", (9, 0, 0), "x")], "over-constrained: locators block.x, block.y hold the same"),
    ],
)
def test_locators_that_hold_the_same_are_named(locators, said):
    a = tc.Assembly("held twice")
    table = a.part("table", tc.Box(50, 50, 5), fixed=True)
    block = a.part("block", tc.Box(10, 10, 5), at=(20, 20, 5))
    a.locate(block, [tc.Locator(*each, 0) for each in locators], floating=True)
    a.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
    a.measure("z", block.point(0, 0, 0), along="z")
    with pytest.raises(ModelError, match=said):
        tc.build(a)


def test_a_part_that_floats_has_to_touch_something():
    a = tc.Assembly("adrift")
    block = a.part("block", tc.Box(10, 10, 5))
    a.locate(block, [], floating=True)
    a.measure("z", block.point(0, 0, 0), along="z")
    (fault,) = tc.check(a)
    assert "floating, in no contact pair and on no one-sided locator, so nothing decides its place" in fault


def test_one_sided_locators_hold_a_floating_part_as_they_hold_any_other():
    def on_three_supports(is_floating):
        a = tc.Assembly("on supports", method=tc.Method(objective="seating"))
        block = a.part("block", tc.Box(100, 50, 10))
        points = [(5, 5, 0), (95, 5, 0), (50, 45, 0), (5, 0, 5), (95, 0, 5), (0, 25, 5)]
        a.locate(
            block,
            [tc.Locator(str(k), p, n, 0.2, one_sided=n == "z") for k, (p, n) in enumerate(zip(points, "zzzyyx", strict=True))],
            floating=is_floating,
        )
        a.force("weight", at=block.point(50, 20, 5), vector=(0, 0, -10))
        a.measure("height", block.point(50, 20, 0), along="z")
        return a

    afloat, fixed = (realizations(compiled(on_three_supports(k)), samples=200, seed=1) for k in (True, False))
    assert_resolved(afloat)
    heights = [results.measured.sel(state="corrected").values for results in (afloat, fixed)]
    assert np.abs(heights[0] - heights[1]).max() < 1e-9
