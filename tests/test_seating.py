"""Forces, one-sided locators and springs: who carries, and how much."""

import itertools
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests import cases
from tests.cases.tables import LEGS, WEIGHT, table
from tests.helpers import EXACT, SEATED, R_t, moved_at_locators, placed, simulate
from tolcontact.vocabulary import CORRECTED, RAW, Status


def heights_over_supports(run, program, state):
    """How far each leg's foot is above its support, (realization, leg): from the poses and deviations alone."""
    (part,) = program.nominal.parts
    feet = placed(part.locators.points[:4], run["poses"][:, state, 0])
    return feet[..., 2] - run["deviations"][:, :4]


@pytest.mark.parametrize("solver", ["qpoases", "daqp"])
def test_a_table_rocks_onto_the_three_legs_that_can_carry_its_weight(solver):
    program, run = simulate(table(), samples=500, solver=solver, method=SEATED)
    assert (run["status"] == Status.RESOLVED).all()
    apart = heights_over_supports(run, program, CORRECTED)
    assert apart.min() > -1e-9
    assert ((np.abs(apart) < 1e-8).sum(axis=1) == 3).all()
    assert (run["carrying"] == 3).all()
    # The weight's line of action goes through the triangle of the legs that carry.
    (part,) = program.nominal.parts
    R, t = R_t(run["poses"][:, CORRECTED, 0])
    feet = placed(part.locators.points[:4], run["poses"][:, CORRECTED, 0])
    weight = R @ [*WEIGHT, 42] + t
    for k in range(500):
        down = np.flatnonzero(np.abs(apart[k]) < 1e-8)
        shares = np.linalg.solve(np.vstack([feet[k, down, :2].T, np.ones(3)]), [*weight[k, :2], 1])
        assert (shares > -1e-3).all()
    assert np.abs(run["reaction"] - 100).max() < 0.02  # the quadratic term and the tilt hold the rest


def test_the_seat_is_the_one_that_trying_all_triples_finds():
    """First order: the plane on three supports under which no fourth stands out, with the weight between the three."""
    _, run = simulate(table(), samples=200, method=replace(SEATED, resolution="linearized", search="fixed"))
    height = run["deviations"][:, :4]
    for k in range(200):
        planes = []
        for down in map(list, itertools.combinations(range(4), 3)):
            plane = np.linalg.solve(np.column_stack([LEGS[down], np.ones(3)]), height[k, down])
            shares = np.linalg.solve(np.vstack([LEGS[down].T, np.ones(3)]), [*WEIGHT, 1])
            if (np.column_stack([LEGS, np.ones(4)]) @ plane >= height[k] - 1e-12).all() and (shares > 0).all():
                planes.append(plane)
        (plane,) = planes
        # Feet lie 40 mm below and turn with the plate: heights agree to the second order of the tilt.
        assert run["measured"][k, CORRECTED, 1] == pytest.approx(plane @ [50, 30, 1], abs=2e-2)


def test_the_raw_pose_fits_more_than_six_locators_by_least_squares():
    program, run = simulate(table(), samples=50)
    apart = heights_over_supports(run, program, RAW)
    # With four legs at the corners of a rectangle the residuals of the best plane alternate.
    assert np.abs(apart @ [1, -1, 1, -1] / 4 - apart[:, 0]).max() < 1e-2
    guided = moved_at_locators(program.nominal.parts[0], run["poses"][:, RAW, 0])[:, 4:]
    assert np.abs(guided).max() < 2e-2  # two-sided locators are kept exactly, to first order


def test_without_a_force_a_part_is_lifted_off_supports_that_it_sinks_into():
    program, run = simulate(table(), samples=200, method=EXACT)
    assert heights_over_supports(run, program, CORRECTED).min() > -1e-9
    assert (run["status"] != Status.NOT_CONVERGED).all()


def test_a_force_that_finds_nothing_to_rest_on_is_reported():
    for resolution in ("linearized", "exact"):
        method = tc.Method(objective="seating", resolution=resolution)
        _, run = simulate(table(weight=-100.0), samples=20, method=method)
        assert (run["status"] == Status.NOT_CONVERGED).all()
        assert np.isfinite(run["poses"]).all()


def test_a_force_that_moves_nothing_is_refused():
    a = table()
    block = a.part("block", tc.Box(10, 10, 10), at=(200, 0, 0), fixed=True)
    a.force("idle", at=block.point(5, 5, 10), vector=(0, 0, -1))
    with pytest.raises(tc.TolcontactError, match='force "idle" acts on part "block"'):
        tc.build(a, method=SEATED)


@pytest.mark.parametrize("solver", ["daqp", "qpoases", "osqp"])
def test_reactions_balance_the_weight_however_many_supports_share_it(solver):
    legs = np.array([(5 + 18 * k, y) for k in range(6) for y in (5, 55)], dtype=float)
    a = table(legs=legs, tolerance=0.0)
    _, run = simulate(a, samples=3, solver=solver, method=SEATED)
    assert (run["status"] == Status.RESOLVED).all()
    assert np.abs(run["reaction"].sum(axis=1) - 100).max() < 0.05


def test_seating_does_not_depend_on_where_the_assembly_stands():
    _, still = simulate(table(), method=SEATED)
    for frame in (cases.Frame(shift=(1000, -700, 400)), cases.Frame(turn=(2, 1, -1), shift=(-900, 300, 800))):
        _, moved = simulate(table(frame), method=SEATED)
        assert np.abs(moved["measured"] - still["measured"]).max() < 1e-8
    _, double = simulate(table(cases.Frame(scale=2.0)), method=SEATED)
    assert np.abs(double["measured"] - 2 * still["measured"]).max() < 1e-8


def test_a_part_pressed_onto_a_base_rests_on_three_points_and_keeps_its_guides():
    """RA1's top with one-sided A locators: it rests on the base or on its supports, whichever stands higher."""
    a = tc.Assembly("pressed")
    base = a.part("base", tc.Box(100, 50, 10))
    top = a.part("top", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    a.locate(base, tc.three_two_one(base.face("-z"), base.face("-y"), base.face("-x"), inset=5), tolerance=1)
    supports = [tc.Locator(f"A{k}", p, "z", 1, one_sided=True) for k, p in enumerate([(5, 5, 0), (45, 5, 0), (25, 20, 0)])]
    guides = [tc.Locator("B1", (5, 0, 5), "y", 1), tc.Locator("B2", (45, 0, 5), "y", 1), tc.Locator("C", (0, 12, 5), "x", 1)]
    a.locate(top, [*supports, *guides])
    a.contact("interface", moving=top.face("-z"), reference=base.face("+z"), points=60)
    a.force("clamp", at=top.point(25, 10, 10), vector=(0, 0, -50))
    a.measure("height", top.point(25, 10, 10), along="z")
    program, run = simulate(a, samples=300, method=SEATED)
    assert (run["status"] == Status.RESOLVED).all()
    assert run["gap_min"][:, CORRECTED].min() > -1e-8
    assert (run["carrying"].sum(axis=1) >= 3).all()
    part, start = program.nominal.parts[1], 6
    moved = moved_at_locators(part, run["poses"][:, CORRECTED, 1])
    assert np.abs(moved[:, 3:] - run["deviations"][:, start + 3 :]).max() < 1e-8
    assert (moved[:, :3] - run["deviations"][:, start : start + 3]).min() > -1e-8
    # Vertical balance: base and supports together carry the clamp, but for the tilt of the base.
    assert np.abs(run["reaction"].sum(axis=1) - 50).max() < 0.5


def test_springs_share_a_push_by_their_stiffness():
    """A block pushed up in its middle by 0.01 mm: springs at its ends, one ten times as stiff as the other."""
    a = tc.Assembly("springs")
    wedge = a.part("wedge", tc.Box(2, 10, 10), at=(49, 0, -9.99), fixed=True)
    bar = a.part("bar", tc.Box(100, 10, 10), fixed=False)
    stiff = {"stiffness": 10.0}
    a.locate(
        bar,
        [
            tc.Locator("left1", (0, 0, 0), "z", 0, **stiff), tc.Locator("left2", (0, 10, 0), "z", 0, **stiff),
            tc.Locator("right", (100, 5, 0), "z", 0), tc.Locator("B1", (0, 0, 0), "y", 0),
            tc.Locator("B2", (100, 0, 0), "y", 0), tc.Locator("C", (0, 5, 0), "x", 0),
        ],
    )  # fmt: skip
    a.contact("tip", moving=wedge.face("+z"), reference=bar.face("-z"), points=9)
    a.measure("left end", bar.point(0, 5, 0), along="z")
    a.measure("right end", bar.point(100, 5, 0), along="z")
    _, run = simulate(a, samples=2, method=tc.Method(objective="locator stiffness"))
    assert (run["status"] == Status.RESOLVED).all()
    left, right = run["measured"][0, CORRECTED]
    x = 50 + np.array([-1, 1]) * 1.0  # the wedge's edges; the bar, turning, rests on one of them
    rest = min(x, key=lambda at: abs(left + (right - left) * at / 100 - 0.01))
    assert left + (right - left) * rest / 100 == pytest.approx(0.01, abs=1e-6)
    # Statics: forces 20 N/mm * left and 1 N/mm * right balance about the rest.
    assert 20 * left * rest == pytest.approx(1 * right * (100 - rest), rel=1e-5)
    assert run["reaction"][0, 0] == pytest.approx(20 * left + right, rel=1e-4)  # the normal tilts with the bar


def ring_on_a_pin(turn=(0, 0, 0), push=(0, 0, 0), last=None) -> tc.Assembly:
    """A ring on a plate around a pin, pushed down and sideways at a point; stops stand 1 mm beside it."""
    a, R = tc.Assembly("ring", method=SEATED), Rotation.from_rotvec(turn)
    plate = a.part("plate", tc.Box(100, 100, 10), at=R.apply((-50, -50, -10)), rotation=turn, fixed=True)
    pin = a.part("pin", tc.Pin(19.8, 30), at=R.apply((0, 0, 25.5)), rotation=turn, fixed=True)
    ring = a.part("ring", tc.Mesh(trimesh.creation.annulus(10, 20, 10, sections=48)), at=R.apply((0, 0, 5)), rotation=turn)
    stops = "Z1:15,0,-5:z", "Z2:-15,0,-5:z", "Z3:0,15,-5:z", "X:-20,0,0:x", "Y1:0,-20,0:y", "Y2:3,-19.5,0:y"
    locators = cases.parked(*stops, away=1)
    a.locate(ring, locators if last is None else [*locators[:-1], last], tolerance=0.1)
    a.force("push", at=ring.point(*push), vector=R.apply((3, 1, -10)))
    a.contact("floor", moving=ring.face("-z"), reference=plate.face("+z"))
    a.contact("bore", moving=ring.face(tc.select.Cylinder(radius=10)), reference=pin.face(tc.select.Cylinder(radius=9.9)))
    a.measure("radial", ring.point(20, 0, 5), along=R.apply((1, 0, 0)), tolerance=1)
    a.measure("mark", ring.point(20, 0, 5), along=R.apply((0, 1, 0)), tolerance=1)
    return a


BESIDE = tc.Locator("S", (20, 0, 0), "y", one_sided=True)


@pytest.mark.parametrize("turn", [(0, 0, 0), (0.4, -1.1, 0.7)])
@pytest.mark.parametrize("last, push, is_free", [
    (None, (0, 0, 0), True),
    (BESIDE, (0, 0, 0), True),
    (BESIDE, (4, -12, 0), False),  # the push rotates the ring onto the stop
    (tc.Locator("S", (20, 0, 0), "y"), (0, 0, 0), False),
])  # fmt: skip
def test_a_rotation_that_nothing_holds_is_named_with_its_axis(turn, last, push, is_free):
    with warnings.catch_warnings(record=True) as records:
        warnings.simplefilter("always")
        tc.build(ring_on_a_pin(turn, push, last), solver="daqp")
    (found,) = [str(record.message) for record in records if "nothing holds its rotation" in str(record.message)] or [""]
    assert ('but "mark" depends on it' in found) == is_free
    if is_free:
        point, axis = (np.array(list(map(float, text.split(", ")))) for text in re.findall(r"\(([-\d., e]+)\)", found))
        up = Rotation.from_rotvec(turn).apply((0, 0, 1))
        assert np.linalg.norm(np.cross(axis, up)) < 1e-3 and np.linalg.norm(np.cross(point, up)) < 1e-2
