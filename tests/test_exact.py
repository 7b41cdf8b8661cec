"""The exact resolution against ipopt on the true problem, and on assemblies of many bodies and opposed faces."""

import numpy as np
import pytest

import tolcontact as tc
from tests import cases, referee
from tests.helpers import (
    EXACT,
    FIXED,
    PAPER,
    SEATED,
    SEATED_ON_POINTS,
    R_t,
    compiled,
    joined,
    moved_at_locators,
    nightly,
    simulate,
)
from tests.nonlinear import TrueProblem
from tolcontact.simulation import simulate_block, simulate_blocks
from tolcontact.variation import draw
from tolcontact.vocabulary import CORRECTED, RAW, Status

JUDGED = {
    "ra1": (cases.ra1, "active points"),
    "stack": (cases.stack, "all points"),
    "jaws": (cases.jaws, "locator stiffness"),
    "ring": (cases.ring, "all points"),
    "table": (cases.table, "seating"),
}


@pytest.mark.slow
@pytest.mark.parametrize("samples", [60, *nightly(200)])
@pytest.mark.parametrize("name", ["stack", "table", *nightly(*(name for name in JUDGED if name not in ("stack", "table")))])
def test_no_nonlinear_solver_does_better(name, samples):
    """Objective within 1e-6 of ipopt's or lower, no gap, and a KKT residual found without our multipliers."""
    make, objective = JUDGED[name]
    program, run = simulate(make(), samples=samples, solver="daqp", method=tc.Method(search="fixed", objective=objective))
    problem = TrueProblem(program.nominal, objective)
    content = 0
    for k in np.flatnonzero(run["status"] != Status.UNTOUCHED):
        assert run["status"][k] == Status.RESOLVED
        raw, poses, deviations = run["poses"][k, RAW], run["poses"][k, CORRECTED], run["deviations"][k]
        weights = problem.weights(raw, deviations)
        energy, gap, residual = problem.judge(raw, poses, deviations, weights)
        assert gap > -1e-9
        assert residual < 1e-6
        least, solved = problem.solve(raw, deviations, weights)
        content += solved
        assert not solved or energy <= least + 1e-6 * abs(least)
    assert content > 0.9 * (run["status"] != Status.UNTOUCHED).sum()


def certified(program, run):
    """The least gaps, recomputed by the paper's formula from the poses alone; rotations that are rotations."""
    R, t = R_t(run["poses"][:, CORRECTED])
    assert np.abs(R @ R.swapaxes(-1, -2) - np.eye(3)).max() < 1e-12
    least = [[referee.gaps(pair, R[k], t[k]).min() for pair in program.nominal.pairs] for k in range(len(R))]
    assert np.abs(np.array(least) - run["gap_min"][:, CORRECTED]).max() < 1e-9
    return np.min(least, axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("objective", ["all points", *nightly("active points", "locator stiffness")])
@pytest.mark.parametrize("make", [cases.jaws, *nightly(lambda: cases.model("tower"), cases.ring)])
def test_many_bodies_are_resolved(make, objective):
    program, run = simulate(make(), samples=200, solver="daqp", method=tc.Method(search="fixed", objective=objective))
    assert (run["gap_min"][:, RAW].min(axis=1) < -0.01).all()
    far = run["status"] == Status.DOUBTFUL
    assert (run["status"][~far] == Status.RESOLVED).all()
    # "active points" hold a block by the points that penetrate: one that touches nothing as placed may slide off.
    assert not far.any() or (make.__name__ == "<lambda>" and objective == "active points")
    for k in np.flatnonzero(far):
        R, t = (after - before for before, after in R_t(run["poses"][k]))
        slid = [np.linalg.norm(pair.P_m @ R[pair.moving].T + t[pair.moving], axis=1).max() for pair in program.nominal.pairs]
        block = int(np.argmax(slid))  # which joint `block` sets down, and joint `block` + 1 loads
        assert slid[block] > 0.5 * 40 and (run["gap_min"][k, RAW, block : block + 2] > 0).all()
    assert certified(program, run).min() > -1e-9
    assert (run["carrying"].sum(axis=1) > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize(("solver", "samples"), [("daqp", 1000), *nightly(("qpoases", 1000), ("daqp", 10_000))])
def test_opposed_faces_without_clearance(solver, samples):
    """One linear step cannot open all gaps of a U in a U, repeated ones always do. The pose there is a slide along y."""
    program, run = simulate(cases.model("channel"), samples=samples, solver=solver, method=EXACT)
    assert (run["status"] == Status.RESOLVED).all()
    assert run["gap_min"][:, CORRECTED].min() > -1e-6
    R, t = R_t(run["poses"][:, CORRECTED, program.nominal.assembly.parts.index(program.nominal.parts[1].part)])
    assert np.abs(t[:, 0]).max() < 1e-6
    assert np.abs(R[:, 0, 1]).max() < 1e-6
    _, linear = simulate(cases.model("channel"), samples=300, solver=solver, method=PAPER)
    assert (linear["status"] == Status.NOT_CONVERGED).mean() > 0.4
    assert linear["gap_min"][:, CORRECTED].min() < -0.1


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["daqp", *nightly("qpoases")])
def test_a_tab_wider_than_its_slot_is_not_assemblable(solver):
    _, run = simulate(cases.tab(), samples=100 if solver == "daqp" else 20, solver=solver, method=EXACT)
    assert (run["status"] == Status.NOT_ASSEMBLABLE).all()
    # The excess of 0.1 mm is shared by both sides, and the floor has no part in it.
    sides, floor = run["gap_min"][:, CORRECTED, :2], run["gap_min"][:, CORRECTED, 2]
    assert np.abs(sides + 0.05).max() < 1e-6
    assert floor.min() > -1e-8
    _, fits = simulate(cases.tab(slot=10.0), samples=100, solver=solver, method=EXACT)
    assert (fits["status"] == Status.RESOLVED).all()


@pytest.mark.slow
@pytest.mark.parametrize(("method", "start", "stop"), [(SEATED_ON_POINTS, 2000, 2500), *nightly((SEATED, 0, 4000))])
def test_conflicts_do_not_loosen_two_sided_locators(method, start, stop):
    """Also with a solver that finds no rest there: poses of least penetration are poses that the locators allow."""
    program = compiled(cases.square_pins(), solver="daqp", method=method)
    block = simulate_block(program, draw(program.nominal, seed=8, start=start, stop=stop))
    stuck = block.status == Status.NOT_ASSEMBLABLE
    assert stuck.sum() > (stop - start) / 40 and stuck[2217 - start]
    plate = program.nominal.parts[0]
    moved = moved_at_locators(plate, block.poses[:, CORRECTED, 0])[:, ~plate.locators.one_sided]
    assert np.abs(moved[stuck | (block.status == Status.RESOLVED)]).max() < 1e-8


@pytest.mark.slow
def test_conflicts_depend_on_no_other_realization():
    """Also where the solver fails and another one answers: slacks hardly open the rows of points that are nearly in a line."""
    program = compiled(cases.everything_of_boxes(), solver="daqp", method=SEATED_ON_POINTS)
    whole, single = (joined(simulate_blocks(program, samples=16, seed=5, block=size, threads=1)) for size in (16, 1))
    stuck = whole["status"] == Status.NOT_ASSEMBLABLE
    assert stuck.sum() >= 4 and whole["second_answers"][stuck].all()
    assert np.array_equal(whole["poses"], single["poses"])


@pytest.mark.slow
def test_the_bounded_search_follows_curved_surfaces():
    """A roller set down beside the top of another: its axis must end 20 mm from the other's, to the mesh's chord error."""
    away = {}
    for search in ("fixed", "bounded"):
        rollers, method = cases.rollers(sections=180), tc.Method(resolution="exact", search=search)
        _, run = simulate(rollers, samples=100, solver="daqp", method=method)
        assert np.isin(run["status"], [Status.UNTOUCHED, Status.RESOLVED]).all()
        R, t = R_t(run["poses"][:, CORRECTED, 1])
        axis = R @ [0, 20, 0] + t
        away[search] = np.linalg.norm(axis[run["status"] == Status.RESOLVED, :2], axis=1) - 20
    assert away["fixed"].max() > 0.3  # nominal contact points keep parts apart that turned away from them
    assert np.abs(away["bounded"]).max() < 20 * (1 - np.cos(np.pi / 180)) + 1e-6


def test_points_that_slid_beyond_the_rim_hold_nothing():
    """A block tips over a ledge and slides 30 mm against a wall: in the end it rests on the ledge's present points."""
    a = tc.Assembly("ledge")
    ledge = a.part("ledge", tc.Box(50, 40, 10), at=(0, 0, -9), fixed=True)
    wall = a.part("wall", tc.Box(10, 40, 30), at=(130, 0, -10), fixed=True)
    block = a.part("block", tc.Box(100, 40, 10))
    supports = {"A1": ((95, 5, 0), "z"), "A2": ((95, 35, 0), "z"), "A3": ((5, 20, 0), "z"), "C": ((0, 20, 5), "x")}
    guides = [tc.Locator("B1", (5, 0, 5), "y", 0), tc.Locator("B2", (95, 0, 5), "y", 0)]
    a.locate(block, [*(tc.Locator(name, *place, 0, one_sided=True) for name, place in supports.items()), *guides])
    a.force("down", at=block.point(85, 20, 5), vector=(0, 0, -100))
    a.force("push", at=block.point(0, 20, 5), vector=(1, 0, 0))
    a.contact("ledge", moving=block.face("-z"), reference=ledge.face("+z"), spacing=2)
    a.contact("wall", moving=block.face("+x"), reference=wall.face("-x"), points=9, within=50)
    a.measure("slide", block.point(0, 0, 0), along="x", tolerance=1)
    method = tc.Method(resolution="exact", objective="seating")
    _, run = simulate(a, samples=2, solver="daqp", method=method)
    assert (run["status"] == Status.RESOLVED).all()
    assert (run["measured"][:, CORRECTED] > 29).all()
    assert (np.abs(run["gap_min"][:, CORRECTED])[run["carrying"] > 0] < 1e-6).all()


def test_a_small_contact_may_be_far_from_where_it_comes_to_rest():
    a = tc.Assembly("pin")
    wall = a.part("wall", tc.Box(10, 40, 40), at=(58, 0, 0), fixed=True)
    pin = a.part("pin", tc.Box(50, 0.2, 0.2), at=(0, 20, 20))
    places = {"A1": ((5, 0.1, 0), "z"), "A2": ((45, 0.1, 0), "z"), "A3": ((25, 0.2, 0), "z")}
    places |= {"B1": ((5, 0, 0.1), "y"), "B2": ((45, 0, 0.1), "y")}
    stop = tc.Locator("stop", (50, 0.1, 0.1), "x", 0.01, one_sided=True)
    a.locate(pin, [*(tc.Locator(name, *place, 0) for name, place in places.items()), stop])
    a.contact("tip", moving=pin.face("+x"), reference=wall.face("-x"), points=9, within=10)
    a.force("push", at=pin.point(0, 0.1, 0.1), vector=(5, 0, 0))
    a.measure("slide", pin.point(0, 0, 0), along="x", tolerance=1)
    _, run = simulate(a, samples=5, solver="daqp", method=SEATED)
    assert (run["status"] == Status.RESOLVED).all()
    assert np.abs(run["measured"][:, CORRECTED] - 8).max() < 1e-9


def test_the_linearized_resolution_leaves_penetration_that_the_exact_one_does_not():
    _, linear = simulate(cases.stack(), samples=300, solver="daqp", method=PAPER)
    _, exact = simulate(cases.stack(), samples=300, solver="daqp", method=EXACT)
    assert linear["gap_min"][:, CORRECTED].min() < -1e-3
    assert exact["gap_min"][:, CORRECTED].min() > -1e-9
    assert (linear["iterations"] <= 1).all()


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["qpoases", "proxqp"])
@pytest.mark.parametrize("make", [*nightly(cases.ra1, cases.stack), cases.jaws], ids=["ra1", "stack", "jaws"])
def test_solvers_come_to_the_same_exact_poses(make, solver):
    # Where faces end, the last digits of a QP may decide between two optima: proxqp gives only 1e-9.
    method = FIXED if solver == "proxqp" else EXACT
    _, reference = simulate(make(), samples=100, solver="daqp", method=method)
    _, run = simulate(make(), samples=100, solver=solver, method=method)
    assert (run["status"] == reference["status"]).all()
    # The steps end when they are as small as the solver is accurate; where faces end, a place may be replaced in the last one.
    accuracy = {"proxqp": 1e-6, "qpoases": 1e-8 if make is cases.jaws else 1e-9}[solver]
    assert np.abs(run["poses"] - reference["poses"]).max() < accuracy


def test_steps_in_a_channel_come_to_rest():
    """Newton's steps need the curvature of the gaps, weighted by the reactions: without it they take a quarter more."""
    _, run = simulate(cases.model("channel"), samples=40, solver="daqp", method=FIXED)
    assert (run["status"] == Status.RESOLVED).all() and run["iterations"].max() <= 24
