"""Balls and shafts beside walls, against closed forms: exact per realization, at any tessellation, in any frame."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tests.cases import round_contact as round_cases
from tests.helpers import R_t, compiled, nightly, simulate
from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run
from tolcontact.vocabulary import CORRECTED, Status

SEATED = tc.Method(objective="seating", resolution="exact")
SOLVERS = ("daqp", "qpoases")
AS1 = Path(__file__).resolve().parents[1] / "studies" / "cad" / "as1-oc-214.stp"


def seated(make, solver="daqp", samples=60):
    """The nominal pairs, and R (n, part, 3, 3), t (n, part, 3) of the corrected state; every realization is resolved."""
    program, run = simulate(make, samples=samples, solver=solver, method=SEATED)
    assert (run["status"] == Status.RESOLVED).all()
    assert not any(pair.samples_faces for pair in program.nominal.pairs if not pair.is_supports)
    return program, *R_t(run["poses"][:, CORRECTED])


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("sections", [24, 64])
def test_a_shaft_in_a_v_rests_where_it_should(sections, solver):
    program, run = simulate(cases.shaft_in_a_v(sections), samples=100, solver=solver, method=SEATED)
    assert (run["status"] == Status.RESOLVED).all() and len(program.nominal.pairs[0].P_m) == 2
    heights = run["deviations"][:, program.nominal.locators.labels.index("left.H")]
    heights = (heights + run["deviations"][:, program.nominal.locators.labels.index("right.H")]) / np.sqrt(2)
    assert (
        np.abs(run["measured"][:, CORRECTED, 0] - run["measured"][:, CORRECTED, 0].mean() - heights + heights.mean()).max()
        < 1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_peg_lies_where_the_force_pushes_it(solver):
    _, _, t = seated(cases.peg_in_a_hole(), solver)
    apart = (t[:, 1] - t[:, 0])[:, :2]
    assert np.abs(np.linalg.norm(apart, axis=1) - 0.05).max() < 1e-9
    assert np.abs(apart @ [1, -2] / np.sqrt(5) - 0.05).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("sections", [24, *nightly(96)])
def test_a_jammed_peg_tilts_as_far_as_its_rims_let_it(sections, solver):
    _, R, _ = seated(round_cases.jammed_peg(sections=sections), solver)
    axes = R @ [0, 0, 1.0]
    angle = np.arcsin(np.linalg.norm(np.cross(axes[:, 0], axes[:, 1]), axis=1))
    assert np.abs(angle - round_cases.jamming_angle()).max() * 15 < 1e-8  # mm at the peg's ends


def test_a_short_peg_jams_on_its_own_rims():
    """In a hole twice as long as the peg its own ends touch: (length / 2) sin + radius cos = radius + clearance."""
    a = tc.Assembly("short")
    plate = a.part("plate", tc.Mesh(trimesh.creation.annulus(5.05, 20, 20, sections=48)), fixed=True)
    peg = a.part("peg", tc.Mesh(trimesh.creation.cylinder(5, 10, sections=36)), fixed=False)
    a.locate(plate, round_cases.held(plate, [(20, 0, 0), (-20, 0, 0), (0, 20, 0), (0, 0, 0), (0, 0, 0), (20, 0, 0)], 0.2))
    stops = cases.parked("Z1:5,0,0:z", "Z2:0,5,0:z", "X1:-5,0,0:x", "Y1:0,-5,0:y", "Y2:4,-3,0:y")
    a.locate(peg, [tc.Locator("Z", (0, 0, 0), "z", 0), *stops])
    for z, sign in ((4, 1.0), (-4, -1.0)):
        a.force(f"at {z}", at=peg.point(0, 0, z), vector=(sign, 3 * sign, 0))
    a.contact("fit", moving=plate.face(tc.select.Cylinder(radius=5.05)), reference=peg.face(tc.select.Cylinder(radius=5)))
    a.measure("x", peg.point(0, 0, 0), along="x")
    program, R, _ = seated(a)
    assert (
        not program.nominal.pairs[0].round.points["cut"].any() and not program.nominal.pairs[0].round.points["on_moving"].any()
    )
    axes = R @ [0, 0, 1.0]
    angle = np.arcsin(np.linalg.norm(np.cross(axes[:, 0], axes[:, 1]), axis=1))
    assert np.abs(5 * np.sin(angle) + 5 * np.cos(angle) - 5.05).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cone", *nightly("fine cone")])
def test_a_ball_rests_in_a_cone(name):
    _, R, t = seated(round_cases.EVERY[name]())
    apex, axis = R[:, 0] @ [0, 0, -12.0] + t[:, 0], R[:, 0] @ [0, 0, 1.0]
    centre = R[:, 1] @ [0, 0, 10 * np.sqrt(2) - 12] + t[:, 1]
    assert np.abs(centre - apex - 10 * np.sqrt(2) * axis).max() < 1e-9


def test_a_ball_rests_on_three_pins():
    _, R, t = seated(round_cases.ball_on_three_pins())
    centre = R[:, 3] @ [0, 0, np.sqrt(105.0)] + t[:, 3]
    for k, turn in enumerate(2 * np.pi * np.arange(3) / 3):
        place = R[:, k] @ [8 * np.cos(turn), 8 * np.sin(turn), 0] + t[:, k]
        along = R[:, k] @ [-np.sin(turn), np.cos(turn), 0]
        assert np.abs(np.linalg.norm(np.cross(centre - place, along), axis=1) - 13).max() < 1e-9


def test_a_pin_in_a_slot_touches_an_edge_of_its_side():
    """The distance of the axis from both edges of the side, as lines: the lesser is the pin's radius."""
    _, R, t = seated(round_cases.cylinder_in_a_slot())
    axis, edge = R[:, 2] @ [0, 0, 1.0], R[:, 0] @ [1.0, 0, 0]
    across = np.cross(edge, axis)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    apart = [np.abs(((t[:, 2] - R[:, 0] @ [0, 4.1, z] - t[:, 0]) * across).sum(axis=1)) for z in (-4, 4)]
    assert np.abs(np.min(apart, axis=0) - 4).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cone", *nightly(*(name for name in round_cases.EVERY if name != "cone"))])
def test_archived_gaps_of_round_faces_recompute_and_the_model_runs_again(name, tmp_path):
    program = compiled(round_cases.EVERY[name](), method=SEATED, solver="daqp")
    with tc.run(program, samples=40, out=tmp_path / "run.nc", keep="all") as results:
        assert_resolved(results)
        assert_gaps_recompute(results, within=1e-10)
        assert_same_run(
            results, tc.run(compiled(tc.io.model_of(results), method=SEATED, solver="daqp"), samples=40, keep="all")
        )
        assert float(results["surface"].surface_penetration.max()) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("name", ["peg", "V", "cone", "slot", *nightly("fine cone")])
def test_steps_along_walls_that_are_known_come_to_rest_soon(name):
    """Before Newton's steps begin, the ninth: gaps of round faces have their curvature from the first one on."""
    _, run = simulate(round_cases.EVERY[name](), samples=60, solver="daqp", method=SEATED)
    assert (run["status"] == Status.RESOLVED).all() and run["iterations"].max() <= 8


@pytest.mark.slow
def test_linearized_steps_start_from_the_exact_gaps():
    program = compiled(cases.peg_in_a_hole(), solver="daqp", method=tc.Method(objective="all points"))
    results = tc.run(program, samples=60)
    assert_gaps_recompute(results)
    assert_resolved(results)


def test_a_ball_in_a_socket_lies_where_its_weight_points_to():
    """A quarter of a ball's surface, hollow: the centre is off the socket's by the clearance, along the force."""
    a = tc.Assembly("socket")
    cup = trimesh.creation.icosphere(4, radius=10.2)
    cup.update_faces(cup.triangles_center[:, 2] < -3)
    cup.invert()
    socket = a.part("socket", tc.Mesh(cup), fixed=True)
    ball = a.part("ball", tc.Mesh(trimesh.creation.icosphere(3, radius=10)), fixed=False)
    a.locate(socket, round_cases.held(socket, [(9, 0, -9), (-9, 0, -9), (0, 9, -9), (0, 0, -9), (0, 0, -9), (9, 0, -9)], 0.3))
    a.locate(
        ball, cases.parked("Z1:5,0,-8:z", "Z2:-5,0,-8:z", "Z3:0,5,-8:z", "X:-10,0,0:x", "Y1:0,-10,0:y", "Y2:3,-9,0:y", away=1)
    )
    a.force("weight", at=ball.point(0, 0, 0), vector=(2, 1, -5))
    a.contact("fit", moving=ball.face(), reference=socket.face())
    a.measure("height", ball.point(0, 0, 0), along="z")
    _, _, t = seated(a)
    apart = t[:, 1] - t[:, 0]
    assert np.abs(np.linalg.norm(apart, axis=1) - 0.2).max() < 1e-9
    # A thousandth of the forces is a spring to where the ball was set down.
    assert np.abs(apart - 0.2 * np.array([2, 1, -5]) / np.sqrt(30)).max() < 1e-4


@pytest.mark.slow
def test_a_bolt_finds_the_hole_of_its_own_size_in_a_file_from_others():
    """Both of radius 5, in halves that are fitted to vertices: nothing is left but the hole's axis."""
    a = tc.Assembly("bolt", method=tc.Method(resolution="exact", objective="all points"))
    plate = tc.io.parts_from(a, AS1, ["plate_1"], fixed=True)["plate_1"]
    bolt = tc.io.parts_from(a, AS1, ["bolt_1"])["bolt_1"]
    a.locate(bolt, round_cases.held(bolt, [(5, 0, 0), (-5, 0, 0), (0, 5, 0), (0, 0, 0), (0, 0, 0), (5, 0, 0)], 0.2))
    hole = plate.face(tc.select.Cylinder(radius=5, inner=True), tc.select.Inside((15, 65, -1), (35, 85, 25)))
    a.contact("hole", moving=bolt.face(tc.select.Cylinder(radius=5)), reference=hole)
    a.measure("x", bolt.point(0, 0, 0), along="x")
    with tc.run(compiled(a, solver="daqp"), samples=60, seed=1) as results:
        assert_resolved(results)
        assert float(results.gap_min.sel(state="corrected").min()) > -1e-9
        assert np.abs(results.measured.sel(state="corrected")).max() < 1e-5


def turned(frame: cases.Frame) -> tc.Assembly:
    """A peg in a hole, anywhere."""
    a = tc.Assembly("turned")
    plate = a.part("plate", tc.Mesh(trimesh.creation.annulus(5.05, 20, 10, sections=48)), **frame.place(0, 0, 0), fixed=True)
    peg = a.part("peg", tc.Mesh(trimesh.creation.cylinder(5, 20, sections=48)), **frame.place(0, 0, 0))
    places = [((20, 0, 0), "z"), ((-20, 0, 0), "z"), ((0, 20, 0), "z"), ((0, 0, 0), "x"), ((0, 0, 0), "y"), ((20, 0, 0), "y")]
    a.locate(peg, [tc.Locator(f"L{k}", p, d, 0.3) for k, (p, d) in enumerate(places)])
    a.contact("fit", moving=peg.face(tc.select.Cylinder()), reference=plate.face(tc.select.Cylinder(radius=5.05)))
    a.measure("along", peg.point(0, 0, 10), along=frame.along(1, 0, 0))
    a.measure("across", peg.point(0, 0, 10), along=frame.along(0, 1, 0))
    return a


@pytest.mark.slow
@pytest.mark.parametrize("resolution", ["linearized", "exact"])
def test_where_the_assembly_stands_changes_nothing(resolution):
    method = tc.Method(resolution=resolution, objective="all points")
    _, here = simulate(turned(cases.STILL), samples=100, solver="daqp", method=method)
    _, there = simulate(turned(cases.Frame((0.4, -1.1, 2.3), (500, -300, 800))), samples=100, solver="daqp", method=method)
    assert np.abs(here["measured"] - there["measured"]).max() < 1e-8
    assert (here["status"] == there["status"]).all()


@pytest.mark.slow
def test_how_finely_a_step_file_is_triangulated_changes_nothing():
    runs, triangles = [], []
    for chord in (None, 0.3):
        program, run = simulate(round_cases.pinned(chord), samples=100, solver="daqp")
        assert np.isin(run["status"], (Status.UNTOUCHED, Status.RESOLVED)).all()
        runs.append(run["measured"])
        triangles.append(len(program.nominal.parts[0].mesh.faces))
    assert triangles[0] > 5 * triangles[1]
    assert np.abs(runs[0] - runs[1]).max() < 1e-9
