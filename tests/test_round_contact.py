"""Balls and shafts beside walls, against closed forms: exact per realization, at any tessellation, in any frame."""

import itertools
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import tolcontact as tc
from tests import cases
from tests.cases import round_contact as round_cases
from tests.helpers import R_t, simulate
from tolcontact import vocabulary as words
from tolcontact.cli.app import app
from tolcontact.discretization import RoundPoint, RoundPoints, discretize
from tolcontact.discretization.analytic import Form
from tolcontact.discretization.faces import patch
from tolcontact.discretization.round_points import NONE
from tolcontact.mechanics.round_gap import round_gaps
from tolcontact.recomputed import round_points
from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run
from tolcontact.vocabulary import CORRECTED, Status

SEATED = tc.Method(objective="seating", resolution="exact")
SOLVERS = ("daqp", "qpoases")
AS1 = Path(__file__).resolve().parents[1] / "studies" / "cad" / "as1-oc-214.stp"


def seated(make, solver="daqp", samples=60):
    """The nominal pairs, and R (n, part, 3, 3), t (n, part, 3) of the corrected state; every realization is resolved."""
    program, run = simulate(make, samples=samples, solver=solver, method=SEATED)
    assert (run["status"] == Status.RESOLVED).all()
    assert all(pair.round for pair in program.nominal.pairs if not pair.is_supports)
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


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_peg_lies_where_the_force_pushes_it(solver):
    _, _, t = seated(cases.peg_in_a_hole(), solver)
    apart = (t[:, 1] - t[:, 0])[:, :2]
    assert np.abs(np.linalg.norm(apart, axis=1) - 0.05).max() < 1e-9
    assert np.abs(apart @ [1, -2] / np.sqrt(5) - 0.05).max() < 1e-9


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("sections", [24, 96])
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
    a.contact("fit", moving=plate.face(tc.Cylinder(radius=5.05)), reference=peg.face(tc.Cylinder(radius=5)))
    a.measure("x", peg.point(0, 0, 0), along="x")
    program, R, _ = seated(a)
    assert (
        not program.nominal.pairs[0].round.points["cut"].any() and not program.nominal.pairs[0].round.points["on_moving"].any()
    )
    axes = R @ [0, 0, 1.0]
    angle = np.arcsin(np.linalg.norm(np.cross(axes[:, 0], axes[:, 1]), axis=1))
    assert np.abs(5 * np.sin(angle) + 5 * np.cos(angle) - 5.05).max() < 1e-9


def test_a_ball_rests_in_a_cone_and_on_three_pins():
    _, R, t = seated(cases.ball_in_a_cone())
    apex, axis = R[:, 0] @ [0, 0, -12.0] + t[:, 0], R[:, 0] @ [0, 0, 1.0]
    centre = R[:, 1] @ [0, 0, 10 * np.sqrt(2) - 12] + t[:, 1]
    assert np.abs(centre - apex - 10 * np.sqrt(2) * axis).max() < 1e-9
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


MAKES = {
    "peg": cases.peg_in_a_hole, "V": cases.shaft_in_a_v, "cone": cases.ball_in_a_cone, "jammed": round_cases.jammed_peg,
    "pins": round_cases.ball_on_three_pins, "slot": round_cases.cylinder_in_a_slot,
}  # fmt: skip


@pytest.mark.parametrize("name", MAKES)
def test_archived_gaps_of_round_faces_recompute_and_the_model_runs_again(name, tmp_path):
    with tc.run(MAKES[name](), samples=40, method=SEATED, solver="daqp", out=tmp_path / "run.nc", keep="all") as results:
        assert_resolved(results)
        assert_gaps_recompute(results, within=1e-10)
        assert_same_run(results, tc.run(tc.model_of(results), samples=40, method=SEATED, solver="daqp", keep="all"))
        assert float(results["surface"].surface_penetration.max()) < 1e-7


def test_linearized_steps_start_from_the_exact_gaps():
    results = tc.run(cases.peg_in_a_hole(), samples=200, solver="daqp", method=tc.Method(objective="all points"))
    assert_gaps_recompute(results)
    assert_resolved(results)


def check_gaps(points, rng, turn):
    """Gaps computed another way, and their derivatives by differences, at some poses."""
    evaluate, count = round_gaps(points), len(points)
    contact = {"point_of_round": np.arange(count)} | {
        variable.name: values[name]
        for of, values in ((words.OF_WALL, points.walls), (words.OF_ROUND, points.points))
        for name, variable in of.items()
    }
    again = round_points(contact, np.arange(count))
    step = 1e-6
    for _ in range(3):
        R, t = Rotation.from_rotvec(rng.normal(scale=turn, size=3)).as_matrix(), rng.normal(scale=0.2, size=3)
        X, reactions = np.concatenate([R.ravel(), t]), rng.uniform(size=count)
        gaps, slopes, bow, wrap = (each.full() for each in evaluate(X, reactions))
        assert np.abs(gaps.ravel() - [point.gaps(R, t) for point in again]).max() < 1e-11
        moved = [[[part.full() for part in evaluate(X + sign * step * e, reactions)] for sign in (1, -1)] for e in np.eye(12)]
        rates = np.hstack([(up[0] - down[0]) / (2 * step) for up, down in moved])
        bends = np.column_stack([(up[1] - down[1]).T @ reactions / (2 * step) for up, down in moved])
        assert np.abs(rates - slopes).max() < 1e-6 * max(1, np.abs(slopes).max())
        assert np.abs(bends - bow + wrap).max() < 1e-6 * max(1, np.abs(bow - wrap).max())
        assert np.linalg.eigvalsh(wrap).min() > -1e-9 * max(1, np.abs(wrap).max())


@pytest.mark.parametrize("name", MAKES)
def test_gaps_of_round_faces_are_those_of_another_way_and_their_derivatives_theirs(name):
    rng = np.random.default_rng(5)
    for pair in discretize(MAKES[name]()).pairs:
        if pair.round:
            check_gaps(pair.round, rng, turn=3e-3)


def unit(rng):
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def test_a_ball_beside_walls_of_every_kind():
    """Gaps another way, and derivatives by differences; of hollow walls from as far away as a ball that touches them is."""
    rng, points = np.random.default_rng(3), []
    for kind, is_hollow, on_moving in itertools.product(words.SURFACE_KINDS, (False, True), (False, True)):
        if kind in ("plane", "torus") and is_hollow:
            continue
        w = unit(rng)
        x = np.cross(w, unit(rng))
        x /= np.linalg.norm(x)
        sizes = {"cone": {"angle": 0.6}, "plane": {}, "torus": {"radius": 20.0, "minor": 5.0}}.get(kind, {"radius": 20.0})
        wall = Form(kind, rng.normal(size=3), w, **sizes)
        beside = 30 * x + 3 * w if not is_hollow else 6 * x + 20 * w if kind == "cone" else 19 * x + 3 * w
        points.append(RoundPoint(wall, is_hollow, wall.origin + beside, NONE, NONE, 2.0, on_moving, x, np.pi))
    check_gaps(RoundPoints.of(points), rng, turn=3e-2)


def test_a_ball_in_a_hollow_that_is_open_is_free_to_leave():
    """Gaps beyond the end of the wall are those of its last tangent planes; and there is no wall where it is open."""
    rng, points, out = np.random.default_rng(4), [], []
    for kind, angle in itertools.product(("cylinder", "cone", "sphere"), (0.3, 1.5, 3.0)):
        w = unit(rng)
        x = np.cross(w, unit(rng))
        x /= np.linalg.norm(x)
        wall = Form(kind, np.zeros(3), w, **({"angle": 0.6} if kind == "cone" else {"radius": 20.0}))
        aside = np.cos(angle) * x + np.sin(angle) * np.cross(w, x)
        beside = 6 * aside + 20 * w if kind == "cone" else 18.5 * aside
        points.append(RoundPoint(wall, True, beside, NONE, NONE, 2.0, True, x, 1.0))
        out.append(-100 * x)
    check_gaps(RoundPoints.of(points), rng, turn=3e-2)
    shaft, x = Form("cylinder", np.zeros(3), np.array([0, 0, 1.0]), radius=5.05), np.array([1.0, 0, 0])
    ends = [
        RoundPoint(shaft, True, np.array([-1.0, aside, 5.0]), shaft.axis, cut, 5.0, True, x, 1.0)
        for aside, cut in itertools.product((-0.5, 0.7), (NONE, shaft.axis))
    ]
    check_gaps(RoundPoints.of(ends), rng, turn=3e-3)
    for k, far in enumerate(out):
        evaluate = round_gaps(RoundPoints.of([points[k]]))
        assert float(evaluate(np.concatenate([np.eye(3).ravel(), far]), 0)[0]) > 40


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


def test_a_bolt_finds_the_hole_of_its_own_size_in_a_file_from_others():
    """Both of radius 5, in halves that are fitted to vertices: nothing is left but the hole's axis."""
    a = tc.Assembly("bolt", method=tc.Method(resolution="exact", objective="all points"))
    plate = tc.parts_from(a, AS1, ["plate_1"], fixed=True)["plate_1"]
    bolt = tc.parts_from(a, AS1, ["bolt_1"])["bolt_1"]
    a.locate(bolt, round_cases.held(bolt, [(5, 0, 0), (-5, 0, 0), (0, 5, 0), (0, 0, 0), (0, 0, 0), (5, 0, 0)], 0.2))
    hole = plate.face(tc.Cylinder(radius=5, inner=True), tc.Inside((15, 65, -1), (35, 85, 25)))
    a.contact("hole", moving=bolt.face(tc.Cylinder(radius=5)), reference=hole)
    a.measure("x", bolt.point(0, 0, 0), along="x")
    with tc.run(a, samples=200, seed=1, solver="daqp") as results:
        assert_resolved(results)
        assert float(results.gap_min.sel(state="corrected").min()) > -1e-9
        assert np.abs(results.measured.sel(state="corrected")).max() < 1e-5


def test_check_says_which_pairs_are_round():
    listed = CliRunner().invoke(app, ["check", str(cases.MODELS / "cover.py")]).stdout
    assert "contact seat: 78 contact points\n" in listed
    assert "contact round hole: 12 contact points, exact on round faces; triangles up to 0.00061 mm inside\n" in listed


def turned(frame: cases.Frame) -> tc.Assembly:
    """A peg in a hole, anywhere."""
    a = tc.Assembly("turned")
    plate = a.part("plate", tc.Mesh(trimesh.creation.annulus(5.05, 20, 10, sections=48)), **frame.place(0, 0, 0), fixed=True)
    peg = a.part("peg", tc.Mesh(trimesh.creation.cylinder(5, 20, sections=48)), **frame.place(0, 0, 0))
    places = [((20, 0, 0), "z"), ((-20, 0, 0), "z"), ((0, 20, 0), "z"), ((0, 0, 0), "x"), ((0, 0, 0), "y"), ((20, 0, 0), "y")]
    a.locate(peg, [tc.Locator(f"L{k}", p, d, 0.3) for k, (p, d) in enumerate(places)])
    a.contact("fit", moving=peg.face(tc.Cylinder()), reference=plate.face(tc.Cylinder(radius=5.05)))
    a.measure("along", peg.point(0, 0, 10), along=frame.along(1, 0, 0))
    a.measure("across", peg.point(0, 0, 10), along=frame.along(0, 1, 0))
    return a


@pytest.mark.parametrize("resolution", ["linearized", "exact"])
def test_where_the_assembly_stands_changes_nothing(resolution):
    method = tc.Method(resolution=resolution, objective="all points")
    _, here = simulate(turned(cases.STILL), samples=100, solver="daqp", method=method)
    _, there = simulate(turned(cases.Frame((0.4, -1.1, 2.3), (500, -300, 800))), samples=100, solver="daqp", method=method)
    assert np.abs(here["measured"] - there["measured"]).max() < 1e-8
    assert (here["status"] == there["status"]).all()


def test_what_is_not_a_ball_or_a_shaft_beside_a_wall_has_points():
    def pair(pin, reference, **options):
        a = tc.Assembly("not round")
        plate = a.part("plate", reference, fixed=True)
        moving = a.part("pin", tc.Mesh(pin))
        a.locate(moving, round_cases.held(moving, [(4, 0, 0), (-4, 0, 0), (0, 4, 0), (0, 0, 0), (0, 0, 0), (4, 0, 0)], 0.1))
        a.contact("fit", moving=moving.face(tc.Cylinder()), reference=plate.face(tc.Cylinder(radius=5.05)), **options)
        a.measure("x", moving.point(0, 0, 0), along="x")
        (found,) = discretize(a).pairs
        return found

    hole = tc.Mesh(trimesh.creation.annulus(5.05, 20, 10, sections=48))
    upright = trimesh.creation.cylinder(5, 20, sections=48)
    assert pair(upright, hole).round
    assert not pair(upright, hole, points=100).round and not pair(upright, hole, spacing=1.0).round
    askew = upright.copy()
    askew.apply_transform(trimesh.transformations.rotation_matrix(0.005, [1, 0, 0]))
    assert not pair(askew, hole).round  # its axis is not that of the hole
    half = upright.copy()
    half.update_faces(half.triangles_center[:, 0] > 0)
    assert not pair(half, hole).round  # it is not round on all sides


def pinned(chord):
    """A pin in the round hole of the cover's STEP file, which is triangulated within `chord`."""
    a = tc.Assembly("pinned", method=tc.Method(resolution="exact", objective="all points"))
    cover = a.part("cover", tc.Mesh(cases.MODELS / "cover.step", chord=chord), fixed=True)
    pin = a.part("pin", tc.Mesh(trimesh.creation.cylinder(4, 16, sections=30)), at=(15, 15, 4))
    a.locate(pin, round_cases.held(pin, [(4, 0, 0), (-4, 0, 0), (0, 4, 0), (0, 0, 0), (0, 0, 0), (4, 0, 0)], 0.4))
    a.contact("hole", moving=pin.face(tc.Cylinder()), reference=cover.face(tc.Brep((19.05, 15, 1))))
    a.measure("x", pin.point(0, 0, 8), along="x")
    return a


def test_how_finely_a_step_file_is_triangulated_changes_nothing():
    runs, triangles = [], []
    for chord in (None, 0.3):
        program, run = simulate(pinned(chord), samples=100, solver="daqp")
        assert np.isin(run["status"], (Status.UNTOUCHED, Status.RESOLVED)).all()
        runs.append(run["measured"])
        triangles.append(len(program.nominal.parts[0].mesh.faces))
    assert triangles[0] > 5 * triangles[1]
    assert np.abs(runs[0] - runs[1]).max() < 1e-9


def pair_between(moving, own, reference, other, at=(0, 0, 0)):
    """The pair of two meshes whose faces are chosen; the moving one is held."""
    a = tc.Assembly("pair")
    fixed = a.part("fixed", tc.Mesh(reference), fixed=True)
    part = a.part("part", tc.Mesh(moving), at=at)
    a.locate(part, round_cases.held(part, [(4, 0, 0), (-4, 0, 0), (0, 4, 0), (0, 0, 0), (0, 0, 0), (4, 0, 0)], 1.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tc.ContactWarning)
        a.contact("pair", moving=part.face(*own), reference=fixed.face(*other), within=3)
        a.measure("x", part.point(0, 0, 0), along="x")
        (found,) = discretize(a).pairs
    return found


def strip(points, length=40.0):
    """An open surface: a polyline in the plane x, z that is drawn out along y, seen from its left."""
    p = np.array([(x, y, z) for x, z in points for y in (-length / 2, length / 2)], dtype=float)
    faces = [f for k in range(0, len(p) - 2, 2) for f in ((k, k + 2, k + 1), (k + 1, k + 2, k + 3))]
    return trimesh.Trimesh(p, faces, process=False)


BALL = trimesh.creation.icosphere(3, radius=5)


def ANY(centres, normals):
    return np.ones(len(centres), dtype=bool)


def grooved(radius, half, sides=40):
    azimuths = np.linspace(-half, half, sides + 1) - np.pi / 2
    return strip(list(zip(radius * np.cos(azimuths), radius * np.sin(azimuths), strict=True)))


def test_a_ball_beside_edges_gaps_and_curves_that_are_not_known_has_points():
    floor = strip([(-20, 0), (20, 0)])
    assert pair_between(BALL, (), floor, (ANY,), at=(0, 0, 5)).round
    step = strip([(-20, 0), (5, 0), (5, 2), (20, 2)])
    assert not pair_between(BALL, (), step, (ANY,), at=(0.3, 0, 5)).round  # the step's edge is near
    trough = strip([(14 * np.sin(t), -8 * np.cos(t)) for t in np.linspace(-1.5, 1.5, 20)])
    assert not pair_between(BALL, (), trough, (ANY,), at=(0, 0, -2.9)).round
    assert pair_between(BALL, (), grooved(6, 1.5), (ANY,), at=(0, 0, -0.9)).round
    lying = trimesh.creation.cylinder(5, 30, sections=48)
    lying.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    barrel = (tc.Cylinder(),)
    assert pair_between(lying, barrel, grooved(5.2, 1.5), (ANY,), at=(0, 0, -0.1)).round
    assert not pair_between(lying, barrel, grooved(4.9, 1.5), (ANY,), at=(0, 0, 0.1)).round
    small = grooved(4.5, 1.5)
    assert not pair_between(BALL, (), small, (ANY,), at=(0, 0, 2)).round  # it rests on the groove's edges


def test_walls_that_are_not_whole_between_their_ends_are_none():
    pin = trimesh.creation.cylinder(5, 20, sections=48)
    for gaps, is_round in ((1, True), (2, False), (3, False)):
        bore = trimesh.creation.annulus(5.05, 8, 10, sections=72)
        azimuth = np.arctan2(bore.triangles_center[:, 1], bore.triangles_center[:, 0])
        apart = np.abs((azimuth[:, None] - 2 * np.pi * np.arange(gaps) / gaps + np.pi) % (2 * np.pi) - np.pi).min(axis=1)
        bore.update_faces(apart > 0.35)
        assert bool(pair_between(pin, (tc.Cylinder(),), bore, (tc.Cylinder(radius=5.05),)).round) == is_round


def test_faces_that_look_opposite_ways_are_two():
    """A pin above, and a blind hole of its radius below, in line."""
    pin, hole = trimesh.creation.cylinder(5, 10, sections=48), trimesh.creation.annulus(5, 8, 10, sections=48)
    hole.apply_translation([0, 0, -20])
    both = trimesh.util.concatenate([pin, hole])
    part = tc.Assembly("stacked").part("part", tc.Mesh(both))
    face = patch(part.face(tc.Cylinder(radius=5)), {part: both})
    assert sorted(piece.is_hollow for piece in face.pieces) == [False, True]
    for k, piece in enumerate(face.pieces):
        normals = face.corner_normals[face.form_of == k].mean(axis=1)
        assert ((normals * piece.surface.mesh.face_normals).sum(axis=1) > 0.9).all()


def test_points_on_the_axis_of_a_hole_do_not_touch_its_wall():
    plug = trimesh.creation.cylinder(19.9, 10, sections=90)
    bore = trimesh.creation.annulus(20, 30, 20, sections=90)
    pair = pair_between(plug, (ANY,), bore, (tc.Cylinder(radius=20),))
    assert not pair.round and (np.hypot(pair.P_m[:, 0], pair.P_m[:, 1]) > 17).all()


def test_flat_faces_are_flat_however_they_are_turned():
    fine = trimesh.creation.box(bounds=[[-20, -20, -2], [20, 20, 0]]).subdivide().subdivide().subdivide()
    for turn in np.random.default_rng(1).normal(size=(4, 3)):
        a = tc.Assembly("turned")
        frame = cases.Frame(turn)
        floor = a.part("floor", tc.Mesh(fine), **frame.place(0, 0, 0), fixed=True)
        ball = a.part("ball", tc.Mesh(BALL), **frame.place(0, 0, 5))
        a.locate(ball, round_cases.held(ball, [(4, 0, 0), (-4, 0, 0), (0, 4, 0), (0, 0, 0), (0, 0, 0), (4, 0, 0)], 1.0))
        a.contact("rest", moving=ball.face(), reference=floor.face("+z"))
        a.measure("height", ball.point(0, 0, 0), along="z")
        assert len(discretize(a).pairs[0].P_m) == 1
