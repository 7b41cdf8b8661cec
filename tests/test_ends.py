"""Bodies touch as they end: no contact beside a face, none missed at tips and edges, judged by exact distances of polyhedra."""

import functools
import io
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from rich.console import Console

import tolcontact as tc
from models import tower
from studies.certificates.ends import METHOD, judged, scene
from tests.cases.ends import CASES, case, whole_case
from tests.helpers import PAPER, compiled, joined, nightly, simulate
from tolcontact import poses as pose
from tolcontact.compilation import compile_program
from tolcontact.contact import ContactResolver
from tolcontact.discretization import discretize
from tolcontact.report import summary_text
from tolcontact.simulation import simulate_block, simulate_blocks


@functools.cache
def nominal_case(name):
    """The nominal assembly of a case, which is the same for all methods that press no parts, and the pieces of its bodies."""
    assembly, bodies = case(name)
    return discretize(assembly), bodies


def program_of(name, method=METHOD, solver="daqp"):
    assert not method.minimizes.presses
    return compile_program(nominal_case(name)[0], solver, method)


FAULTS = ("false contact", "missed contact", "lifted off", "inside")


def block_of(mesh):
    """A block of a mesh that slides over the end of a table."""
    a = tc.Assembly("a block at an end")
    table = a.part("table", tc.Box(100, 50, 10), fixed=True)
    block = a.part("block", tc.Mesh(mesh), at=(70, 12, 10))
    bottom, stops = [(5, 5, 0), (45, 5, 0), (25, 20, 0)], [(5, 0, 5), (45, 0, 5), (0, 12, 5)]
    points = zip([*bottom, *stops], "zzzyyx", strict=True)
    a.locate(block, [tc.Locator(str(k), p, n) for k, (p, n) in enumerate(points)], tolerance=0.4)
    a.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
    a.measure("height", block.point(50, 0, 10), along="z")
    return a


def test_a_body_that_stands_twice_in_a_mesh_is_one_body():
    box = trimesh.creation.box(bounds=[(0, 0, 0), (50, 25, 10)])
    once, twice = (
        tc.run(compiled(block_of(mesh), method=METHOD), samples=20, seed=1, surfaces=0).measured.values
        for mesh in (box, trimesh.util.concatenate([box, box.copy()]))
    )
    assert np.array_equal(once, twice)


def test_bodies_in_one_place_with_other_triangles_have_no_ends():
    box = trimesh.creation.box(bounds=[(0, 0, 0), (50, 25, 10)])
    mirrored = trimesh.Trimesh(box.vertices * (-1, 1, 1) + (50, 0, 0), box.faces[:, ::-1], process=False)
    with pytest.raises(tc.ModelError, match=r'"interface": the face of part "block" has no ends, .* export one of them'):
        tc.build(block_of(trimesh.util.concatenate([box, mirrored])))


def printed(summary):
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(summary_text(summary))
    return console.export_text()


def assert_right(program, bodies, samples, seed=1, doubted=0):
    counts, _ = judged(program, bodies, samples, seed, None)
    assert {name: counts[name] for name in FAULTS} == dict.fromkeys(FAULTS, 0)
    assert counts["certified"] >= samples - doubted
    return counts


ALIKE = (
    "crossing roofs",
    "chamfer without clearance",
    "needles",
    "steep cone",
    "ridge over an edge",
)  # others are much like these


@pytest.mark.parametrize("samples", [20, *nightly(60)])
@pytest.mark.parametrize("name", [*(name for name in CASES if name not in ALIKE), *nightly(*ALIKE)])
def test_every_certificate_holds_for_the_bodies(name, samples):
    assert_right(program_of(name), nominal_case(name)[1], samples=samples)


@pytest.mark.parametrize("name", ["dovetail", "pin at a rim", *nightly("nut over a washer")])
def test_no_certificate_of_whole_bodies_is_wrong(name):
    """A nut over a washer's rim, a key in a dovetail, a pin that leaves its hole."""
    model, bodies = whole_case(name)
    assert_right(compiled(model, solver="daqp"), bodies, samples=20)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cone", *nightly("crossing roofs", "needles, tilted")])
def test_another_solver_certifies_the_same(name):
    assert_right(program_of(name, solver="qpoases"), nominal_case(name)[1], samples=40)


def test_fixed_planes_would_have_been_wrong():
    """The judge finds what it is there for: planes that do not end hold a plate beside a chamfer, and let a tip sink in."""
    programs = {name: program_of(name, replace(METHOD, search="fixed")) for name in ("chamfer", "cone")}
    chamfer, tip = (judged(program, nominal_case(name)[1], 60, 1, None)[0] for name, program in programs.items())
    assert chamfer["false contact"] > 10
    assert tip["inside"] > 10


@pytest.mark.parametrize("selection", [None, lambda c, n: n[:, 2] > 0.9])
def test_a_plate_that_slides_clear_of_a_chamfered_block_is_never_touched(selection):
    if selection is None:
        model = program_of("chamfer without clearance", solver="qpoases")
    else:
        model, _ = case("chamfer without clearance")
        block, plate = model.parts
        model.contact("top alone", moving=plate.face("-z"), reference=block.face(selection))
        model = compiled(model)
    run = tc.run(model, samples=50, seed=2, surfaces=0, fields="none")
    assert (run.status == 0).all()
    assert np.array_equal(run.measured.sel(state="raw"), run.measured.sel(state="corrected"))


@pytest.mark.slow
def test_few_points_over_a_rib_lose_nothing():
    """Three points in a row: about their line the plate may turn far, at no cost to the objective; that is not certified."""
    model, bodies = case("rib", points=20)
    assert_right(compiled(model, solver="daqp"), bodies, samples=60, doubted=2)


def test_the_frame_does_not_matter(name="rib"):  # whose contact points are the same in every frame
    """Locators, contact and the measured point turn with the assembly; the distance that contact moves the point stays."""
    places = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ((0.3, -0.5, 1.1), (300.0, -200.0, 100.0))
    runs = [tc.run(compiled(case(name, turn=turn, shift=shift)[0]), samples=60, surfaces=0) for turn, shift in places]
    assert np.array_equal(runs[0].status, runs[1].status)
    shifts = [(run.measured.sel(state="corrected") - run.measured.sel(state="raw")).values for run in runs]
    lengths = [np.linalg.norm(shift, axis=1) for shift in shifts]
    assert np.allclose(*lengths, atol=1e-6)


# In scene 38 bodies penetrate by a thousandth of the tolerance range at an edge, where the complete test sees them apart.
@pytest.mark.parametrize("seed", [8, 38, *nightly(0, 2, 4, 6, *range(10, 24, 2))])
def test_random_bodies(seed):
    assembly, bodies = scene(seed)
    assert_right(compiled(assembly, solver="daqp"), bodies, 4, seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, *nightly(1, 3, 5, *range(9, 24, 2))])
def test_random_unions_of_bodies(seed):
    assembly, bodies = scene(seed)
    assert_right(compiled(assembly, solver="daqp"), bodies, 4, seed)


def test_a_bounded_search_needs_the_exact_resolution():
    with pytest.raises(tc.OptionError, match='search is "bounded" with a linearized resolution'):
        tc.Method(resolution="linearized", search="bounded")


def test_contact_of_planes_where_bodies_are_apart_is_measured_and_the_advice_helps():
    """The check after a run looks both ways: a plate held beside a chamfer is found, and is free once faces end."""
    for method, advice in ((replace(METHOD, search="fixed"), 'leave out search="fixed"'), (PAPER, "use --resolution exact")):
        with pytest.warns(
            tc.errors.ContactWarning, match=f'contact pair "contact": contact was resolved where .* apart.*; .*{advice}'
        ):
            fixed = tc.run(program_of("chamfer", method, solver="qpoases"), samples=200, seed=1, fields="none")
        summary, told = tc.summarize(fixed), printed(tc.summarize(fixed))
        assert 0.05 < float(summary.false_contact.max()) < 0.4
        assert 'contact pair "contact": points lie up to' in told and advice in told
        at_random = fixed["surface"].at_random.values == 1
        share, lower, upper = summary.false_contact_share.values
        assert 21 < at_random.sum() < 64 and lower < share < upper
        assert share == (fixed["surface"].false_contact.values[at_random] > 0.006).mean()
        assert 0 < float(summary.contacts_ended) <= float(summary.contacts)
        assert f"{float(summary.contacts_ended):.0f} of {float(summary.contacts):.0f} touching contact points" in told
    bounded = tc.run(program_of("chamfer", solver="qpoases"), samples=50, seed=1, fields="none")
    assert np.isnan(tc.summarize(bounded).false_contact).all()
    assert "apart" not in printed(tc.summarize(bounded))


def stand():
    """Return a block well inside the face of a table: its contact points stay over that face."""
    a = tc.Assembly("stand", method=METHOD)
    table = a.part("table", tc.Box(100, 100, 10), fixed=True)
    block = a.part("block", tc.Box(20, 20, 10), at=(40, 40, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=1)
    a.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
    a.measure("height", block.point(0, 0, 10), along="z", tolerance=1)
    return a


def test_flat_faces_whose_overlap_stays_keep_their_fixed_points():
    program = compiled(stand())
    assert not program.meetings
    assert program.trials[0].error < program.trials[0].allowed


def test_contact_of_faces_that_do_not_end_is_not_called_false():
    run = tc.run(compiled(stand(), method=tc.Method()), samples=200, seed=3)
    assert (run.status == 1).any()
    assert float(tc.summarize(run).false_contact.max()) == 0


@pytest.mark.slow
def test_a_turn_that_contact_barely_holds_is_doubted():
    """The points over a steep cone lie in nearly one place: of few of them that are active, the plate may turn over the tip."""
    program = program_of("steep cone", tc.Method(objective="active points"))
    run = joined(simulate_blocks(program, samples=100, seed=1))
    (places,) = program.meetings.values()
    turns = pose.turn(run["poses"][:, 1, 1], run["poses"][:, 0, 1])
    certified = np.isin(run["status"], [tc.Status.UNTOUCHED, tc.Status.RESOLVED])
    assert (turns > 0.7).sum() > 10 and turns[certified].max() < 2 * places.turn < 0.3
    assert (run["status"][~certified] == tc.Status.DOUBTFUL).all()
    run = joined(simulate_blocks(program_of("steep cone", tc.Method()), samples=100, seed=1))
    assert run["status"].max() == tc.Status.RESOLVED


@pytest.mark.parametrize("solver", ["daqp", "qpoases"])
def test_deviations_beyond_all_that_were_tried_are_resolved_too(solver):
    """Deviations that are given, or drawn far out, may be larger than those that reach was made for: nothing is untouched."""
    a = tc.Assembly("stand")
    table = a.part("table", tc.Box(100, 50, 10), fixed=True)
    block = a.part("block", tc.Box(50, 25, 10), at=(80, 12.5, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=1)
    a.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
    a.measure("height", block.point(0, 0, 0), along="z", tolerance=1)
    program = compiled(a, solver=solver)
    (places,) = program.meetings.values()
    heights = np.array([-0.5, -3.0, 2.0, -5.0, -9.0, 30.0])
    deviations = np.zeros((6, 6))
    deviations[:, :3] = heights[:, None]
    block = simulate_block(program, deviations)
    assert places.reach.depth < 3
    assert block.status.tolist() == [1, 1, 0, 1, 1, 0]
    assert block.gap_min[heights < 0, 0, 0] == pytest.approx(heights[heights < 0])
    assert np.abs(block.gap_min[heights < 0, 1]).max() < 1e-9 and np.abs(block.measured[heights < 0, 1, 0]).max() < 1e-9


@pytest.mark.parametrize("solver", ["daqp", "graph"])
@pytest.mark.parametrize("blocks, samples", [(2, 200), *nightly((6, 600))])
def test_faces_under_load_touch(blocks, samples, solver):
    """A place that stayed beside its edge would hold faces apart, by up to 1e-4 mm: complementarity is that of the bodies."""
    _, run = simulate(tower.assembly(blocks), samples=samples, solver=solver)
    certified = run["status"] == tc.Status.RESOLVED
    loaded = run["reaction"][certified] > 1e-6 * run["reaction"][certified].max(axis=1, keepdims=True)
    assert certified.mean() > 0.9 and loaded.sum() > samples
    assert np.abs(run["gap_min"][certified, 1][loaded]).max() < 1e-9


def test_answers_do_not_depend_on_which_of_two_near_places_carries():
    """In this realization, places of two kinds nearly coincide, and solvers let different ones carry in the first step."""
    programs = [compiled(tower.assembly(6), solver=solver) for solver in ("daqp", "graph")]
    daqp, graph = (simulate_block(p, p.draws(seed=1, start=366, stop=367)) for p in programs)
    assert daqp.status.tolist() == graph.status.tolist() == [tc.Status.RESOLVED]
    assert graph.poses == pytest.approx(daqp.poses, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("blocks", [12, *nightly(24, 48)])
def test_rounds_of_a_step_do_not_grow_with_the_bodies(blocks):
    """Which places wait beside a deeper one hangs on how far deviations move a pair, not on the length of the chain."""
    program = compiled(tower.assembly(blocks), solver="graph")
    deviations = program.draws(seed=1, start=0, stop=20)
    resolvers = [ContactResolver(program, group, max_rounds=2) for group in program.groups]
    two, all_rounds = (simulate_block(program, deviations, resolvers=rs) for rs in (resolvers, None))
    assert two.iterations.mean() < 1.05 * all_rounds.iterations.mean()
    assert two.poses == pytest.approx(all_rounds.poses, abs=1e-9)
