"""Where an answer is looked for from other starts, and what that is good for."""

import functools

import numpy as np
import pytest
import trimesh
from scipy.optimize import linprog

import tolcontact as tc
from tests import cases
from tests.helpers import R_t, compiled, simulate
from tolcontact.vocabulary import CORRECTED, Status

EXACT = tc.Method(resolution="exact")
SEATED = tc.Method(objective="seating", resolution="exact")
FIT = 0.05


@functools.cache
def run_of_peg():
    """Of a round peg, free to spin, that a force pushes to the side of a hole whose place and size vary; on few points."""
    a = tc.Assembly("peg")
    plate = a.part("plate", tc.Mesh(trimesh.creation.annulus(5 + FIT, 20, 10, sections=180)), fixed=True)
    pin = a.part("pin", tc.Mesh(trimesh.creation.cylinder(5, 20, sections=180)), fixed=False)
    feet = [tc.Locator(f"Z{k}", (x, y, -5), "z", 0) for k, (x, y) in enumerate([(20, 0), (-20, 0), (0, 20)])]
    sides = [tc.Locator(f"S{k}", (x, 0, 0), along, 0.2) for k, (x, along) in enumerate([(0, "x"), (0, "y"), (20, "y")])]
    a.locate(plate, [*feet, *sides])
    ends = [tc.Locator(f"Z{k}", (x, y, -10), "z", 0) for k, (x, y) in enumerate([(0, 0), (5, 0), (0, 5)])]
    a.locate(pin, [*ends, *cases.parked("X:-5,0,0:x", "Y1:0,-5,0:y", "Y2:4,-3,0:y")])
    a.force("push", at=pin.point(0, 0, 0), vector=(1, -2, 0))
    wall = plate.face(lambda c, n: (abs(n[:, 2]) < 0.1) & (np.hypot(c[:, 0], c[:, 1]) < 10))
    hole = plate.feature("hole", wall, tc.Size(10 + 2 * FIT, 2e-4, 0))
    a.contact("fit", moving=pin.face(lambda c, n: abs(n[:, 2]) < 0.1), reference=hole, points=200)
    a.measure("x", pin.point(0, 0, 0), along="x", tolerance=0.2)
    return simulate(a, samples=3, solver="daqp", method=SEATED)[1]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_peg_that_rolled_into_the_wall_is_looked_for_again_with_points_projected_anew():
    """Along planes at fixed points it rolls into the wall. In the end it touches where the force points to."""
    run = run_of_peg()
    assert (run["status"] == Status.RESOLVED).all()
    assert (run["starts"] >= 2).all() and (run["searched"] == 1).all()
    _, t = R_t(run["poses"][:, CORRECTED])
    apart = (t[:, 1] - t[:, 0])[:, :2]
    # The chord of 180 sides is off by 8e-4 mm.
    assert np.abs(np.linalg.norm(apart, axis=1) - FIT).max() < 1e-3
    assert np.abs(apart @ [1, -2] / np.sqrt(5) - FIT).max() < 1e-3


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_points_that_are_projected_anew_stand_on_the_face_as_it_came_out():
    """The hole is larger by its size deviation: by half of it the peg goes farther, and touches."""
    run = run_of_peg()
    assert (run["status"] == Status.RESOLVED).all() and (run["searched"] == 1).all()
    _, t = R_t(run["poses"][:, CORRECTED])
    apart = np.linalg.norm((t[:, 1] - t[:, 0])[:, :2], axis=1)
    fit = FIT + run["deviations"][:, -1] / 2
    assert np.ptp(fit) > 3e-5 and np.ptp(apart / fit) < 1e-5  # the chord adds the same share in all of them
    assert np.abs(run["gap_min"][:, CORRECTED, 0]).max() < 1e-8


def test_what_is_certified_near_is_tried_once_and_the_same_conflict_twice():
    """Then three times from where bodies are free of each other, and once along a path of short steps."""
    for make, status, starts in ((cases.tab, Status.NOT_ASSEMBLABLE, 6), (cases.jaws, Status.RESOLVED, 1)):
        _, run = simulate(make(), samples=20, solver="daqp", method=EXACT)
        assert (run["status"] == status).all() and (run["starts"] == starts).all()
        assert (run["iterations"] > starts).all()  # of all starts together


def test_a_tab_that_is_wider_than_its_slot_shares_the_excess_whatever_it_was_tried_from():
    """0.1 mm too wide: the pose of least penetration is in the middle, 0.05 mm in each side."""
    _, run = simulate(cases.tab(9.9), samples=20, solver="daqp", method=EXACT)
    assert np.abs(run["gap_min"][:, CORRECTED, :2] + 0.05).max() < 1e-4
    assert (run["gap_min"][:, CORRECTED, 2] > -1e-4).all()
    assert run["kkt_residual"].max() < 1e-4


@pytest.mark.filterwarnings("ignore")
def test_a_shaft_whose_spin_nothing_holds_comes_to_rest_in_a_lobed_bore():
    """Rounding makes it spin and fall through planes at fixed points; a linear programme over the points knows its place."""
    a = tc.Assembly("lobed")
    ring = a.part("ring", tc.Mesh(trimesh.creation.annulus(10.15, 20, 20, sections=120)), fixed=True)
    shaft = a.part("shaft", tc.Mesh(trimesh.creation.cylinder(10, 20, sections=120)))
    bore = ring.feature("bore", ring.face(tc.select.Cylinder(inner=True)), tc.Cylindricity(0.15, form=tc.Form(lobes=5)))
    a.locate(shaft, [tc.Locator(f"Z{k}", p, "z", 0) for k, p in enumerate([(0, 0, 0), (5, 0, 0), (0, 5, 0)])], floating=True)
    a.contact("fit", moving=shaft.face(tc.select.Cylinder()), reference=bore)
    a.force("weight", at=shaft.point(0, 0, 0), vector=(0, -50, 0))
    a.measure("y", shaft.point(0, 0, 0), along="y")
    program, run = simulate(a, samples=20, seed=2, solver="daqp", method=SEATED)
    assert (run["status"] == Status.RESOLVED).all()
    assert (run["starts"] == 2).sum() >= 5 and not run["searched"].any()
    (pair,) = program.nominal.pairs
    everywhere = np.broadcast_to(np.arange(len(pair.P_m)), (20, len(pair.P_m)))
    clearances = ((pair.P_m - pair.P_r) * pair.n_r).sum(axis=1) - pair.offsets.heights(run["deviations"], everywhere)
    lowest = [linprog([0, 1], A_ub=-pair.n_r[:, :2], b_ub=c, bounds=[(None, None)] * 2).fun for c in clearances]
    assert run["measured"][:, CORRECTED, 0] == pytest.approx(np.array(lowest), abs=1e-9)


def plates_with_a_cap(x, y):
    """Plate in plate, and a cap on the inner plate, at x, y, whose underside varies."""
    a = cases.model("ra2")
    inner = a.parts[1]
    cap = a.part("cap", tc.Box(20, 20, 10), at=(x, y, 2))
    cap.feature("under", cap.face("-z"), tc.Profile(0.02))
    a.locate(cap, tc.three_two_one(cap.face("-z"), cap.face("-y"), cap.face("-x"), inset=2), tolerance=1)
    web = tc.select.Inside((0, -25, 1), (100, 25, 3))
    a.contact("cap", moving=cap.face("-z"), reference=inner.face("+z", web))
    return a


@pytest.mark.slow
def test_a_cap_on_the_middle_of_the_web_is_seen_apart_from_the_outer_plate():
    """One of the half-spaces between them excludes no triangle that another one does not exclude by more."""
    a = plates_with_a_cap(40, -10)
    program = compiled(a, solver="daqp", method=EXACT)
    poses = program.place(deviations=np.zeros((1, len(program.nominal.contributors))))["poses"].reshape(1, 3, 12)
    assert not list(program.watch.clashes(poses, np.zeros((1, len(program.nominal.contributors)))))
