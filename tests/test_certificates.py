"""What a certificate says holds for bodies, near the raw pose, and does not hang on luck."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import tolcontact as tc
from studies.certificates.judge import contradictions
from studies.certificates.scenes import scene
from tests import cases
from tests.helpers import ALL_POINTS, EXACT, PAPER, SEATED, SEATED_ON_POINTS, joined, nightly, recompiled, simulate
from tests.shapes import patch, shape
from tolcontact import poses as pose
from tolcontact.compilation import usable_solvers
from tolcontact.compilation.active_set import ActiveSet
from tolcontact.compilation.conic_plugin import Plugin
from tolcontact.contact import ContactResolver
from tolcontact.contact.acceptance import MAX_TURN
from tolcontact.discretization import discretize
from tolcontact.geometry.overlap import overlap_corners
from tolcontact.simulation import simulate_block, simulate_blocks
from tolcontact.vocabulary import CORRECTED, RAW, Status

SOLVERS = ("daqp", "qpoases")


def largest_turn(run):
    """Largest turn (realization,) of a part between both states."""
    return pose.turn(run["poses"][:, RAW], run["poses"][:, CORRECTED]).max(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wedges", "solver", "samples"), [(3, "daqp", 50), *nightly((3, "daqp", 400), (3, "qpoases", 400), (6, "daqp", 400))]
)
def test_a_ring_closes_where_its_angles_leave_room(wedges, solver, samples):
    """The excess of an impossible ring is left over, shared by the joints, to the second order of the angles."""
    program, run = simulate(cases.hinged_ring(wedges), samples=samples, solver=solver, method=SEATED)
    excess = cases.excess_of_hinged_ring(program.nominal, run["deviations"])
    assert samples / 10 < (excess > 0).sum() < samples * 3 / 10
    assert ((run["status"] == Status.NOT_ASSEMBLABLE) == (excess > 0)).all()
    assert ((run["status"] == Status.RESOLVED) == (excess <= 0)).all()
    assert largest_turn(run)[run["status"] == Status.RESOLVED].max() < MAX_TURN
    left = -run["gap_min"][excess > 0, CORRECTED].min(axis=1)
    # The rim of the faces is 40 mm from the axis, the excess is told at 30.
    assert (left <= excess[excess > 0] * 40 / 30 * 1.01 + 1e-4).all() and (left > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("one_sided", [0, 1, 3])
@pytest.mark.parametrize("width", [0.2, *nightly(0.02)])
def test_a_block_that_its_locators_hold_in_a_wall_is_not_assemblable(width, one_sided):
    runs = [simulate(cases.block_on_six(width, one_sided), samples=100, solver=s, method=SEATED)[1] for s in SOLVERS]
    for run in runs:
        assert (run["status"] == runs[0]["status"]).all()
        assert np.isin(run["status"], [Status.RESOLVED, Status.NOT_ASSEMBLABLE]).all()
        assert largest_turn(run).max() < 0.01
    assert (runs[0]["status"] == Status.NOT_ASSEMBLABLE).sum() > 50
    assert np.abs(runs[0]["poses"] - runs[1]["poses"]).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["daqp", *nightly("qpoases")])
@pytest.mark.parametrize("seed", [1, *nightly(2)])
def test_a_status_does_not_hang_on_the_last_digit(seed, solver):
    """CASES C8, in two frames and in blocks of two sizes: the same status in every row."""
    _, still = simulate(cases.model("channel"), samples=3000, seed=seed, block=4096, solver=solver, method=EXACT)
    assert (still["status"] == Status.RESOLVED).all()
    _, small = simulate(cases.model("channel"), samples=1000, seed=seed, block=37, solver=solver, method=EXACT)
    assert (small["status"] == still["status"][:1000]).all()
    assert np.abs(small["poses"] - still["poses"][:1000]).max() < 1e-6


@pytest.mark.parametrize("solver", ["osqp", "highs", "proxqp", "piqp"])
def test_every_solver_certifies_what_the_others_do(solver):
    if solver not in usable_solvers():
        pytest.skip(f"{solver} does not come with this CasADi")
    _, reference = simulate(cases.stack(), samples=300, solver="daqp", method=PAPER)
    _, run = simulate(cases.stack(), samples=300, solver=solver, method=PAPER)
    assert (run["status"] == reference["status"]).all()
    assert np.abs(run["poses"] - reference["poses"]).max() < 1e-6  # freedoms that only eta holds enlarge the residual
    assert run["kkt_residual"].max() < 1e-8


def test_what_a_solver_misses_another_one_answers():
    """A solver that stops after one iteration: the poses are those of a good one, and the archive says who answered."""
    program, good = simulate(cases.stack(), samples=100, solver="qpoases", method=PAPER)
    lazy = Plugin("daqp", {"daqp": {"iter_limit": 1}}, fallbacks=("qpoases",))
    run = joined(simulate_blocks(recompiled(program, solver=lazy), samples=100, seed=1))
    assert run["second_answers"].sum() > 30 and good["second_answers"].sum() == 0
    assert np.abs(run["poses"] - good["poses"]).max() < 1e-8
    assert (run["status"] == good["status"]).all()
    unaided = recompiled(program, solver=replace(lazy, fallbacks=()))
    alone = joined(simulate_blocks(unaided, samples=100, seed=1))
    lost = alone["status"] == Status.NOT_CONVERGED
    assert lost.sum() > 30
    assert np.abs(alone["poses"][lost, CORRECTED] - alone["poses"][lost, RAW]).max() < 5  # and moves nothing far


@pytest.mark.slow
def test_far_answers_are_not_certified():
    """With a limit of half a degree, hardly any answer of a tower is near."""
    max_turn = np.radians(0.5)
    program, free = simulate(cases.model("tower"), samples=25, solver="daqp", method=ALL_POINTS)
    resolvers = [ContactResolver(program, group, max_turn=max_turn) for group in program.groups]
    run = vars(simulate_block(program, free["deviations"], resolvers=resolvers))
    far = largest_turn(free) > max_turn
    assert far.sum() > 2
    assert (run["status"][far] == Status.DOUBTFUL).all() and (run["starts"][far] == 5).all()
    assert (run["status"][~far] == free["status"][~far]).all()
    assert largest_turn(run)[run["status"] == Status.RESOLVED].max() <= max_turn


def errors_of_the_v(program, run):
    labels = program.nominal.locators.labels
    left, right = (run["deviations"][:, labels.index(f"{side}.H")] for side in ("left", "right"))
    return run["measured"][:, CORRECTED, 0] - (left + right) / np.sqrt(2)


def built(model):
    """A program whose contact points stay where they are, and the warnings of its build about coarse points."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", tc.NominalWarning)
        program = tc.build(model, solver="daqp", method=SEATED_ON_POINTS)
    return program, [text for one in caught if (text := str(one.message)).startswith("[coarse]")]


@pytest.fixture(scope="module")
def shaft_on_points():
    """A shaft whose round faces are overruled by a number of points, and the warnings about them."""
    return built(cases.shaft_in_a_v(720, points=200))


@pytest.mark.slow
def test_a_shaft_on_sampled_points_is_off_and_a_warning_says_by_how_much(shaft_on_points):
    program, warned = shaft_on_points
    run = joined(simulate_blocks(program, samples=100, seed=1))
    assert np.abs(errors_of_the_v(program, run)).max() > 0.01
    assert len(warned) == 2 and "between its contact points" in warned[0] and 'contact pair "left wall"' in warned[0]
    program, warned = built(cases.shaft_in_a_v(64))
    run = joined(simulate_blocks(program, samples=100, seed=1))
    assert np.abs(errors_of_the_v(program, run)).max() < 1e-9 and not warned


@pytest.mark.slow
def test_surfaces_are_checked_between_contact_points(shaft_on_points, tmp_path):
    """A shaft on few points sinks into the walls; the archive says how deep, and the true answer agrees."""
    program, _ = shaft_on_points
    with tc.run(program, samples=60, out=tmp_path / "v.nc", surfaces=20) as results:
        surface, summary = results["surface"].to_dataset().load(), tc.summarize(results)
        corrected = results.to_dataset().sel(state="corrected")[["rotation", "translation"]].load()
    again = tc.run(program, samples=60, keep="measures", surfaces=20)
    rows = surface["realization_checked"].values
    assert len(set(rows)) == 20 and (np.diff(rows) > 0).all() and rows.min() >= 0 and rows.max() < 60
    # The round shaft, from the poses: how deep its ends lie under the planes of the walls.
    R, t = corrected["rotation"].values[rows], corrected["translation"].values[rows]
    walls = surface["surface_penetration"].values[:, :2]
    for k, sign in enumerate((-1, 1)):
        n = R[:, k] @ [sign * np.sqrt(0.5), 0, np.sqrt(0.5)]
        ends = [R[:, 2] @ [0, y, 10 * np.sqrt(2)] + t[:, 2] - t[:, k] for y in (-30, 30)]
        deep = 10 - np.min([(n * end).sum(axis=1) for end in ends], axis=0)
        assert deep.min() > 0.01
        assert np.abs(walls[:, k] - deep).max() < 2e-4  # of triangles, which lie 1e-4 mm inside the round shaft
    assert float(summary["surface_penetration"]) == walls.max() and int(summary["surfaces_checked"]) == 20
    assert np.abs(again["surface/surface_penetration"].values[:, :2] - walls).max() < 1e-6


def test_points_beside_the_rim_of_a_face_are_told():
    """RA1's top block stands out over the end of the base."""
    results = tc.run(cases.ra1(), samples=300, solver="daqp", method=PAPER)
    summary = tc.summarize(results)
    assert float(summary["surface_penetration"]) < 1e-9
    assert 1 < float(summary["beside"]) < 15


def test_polishing_finds_the_solution_from_the_rows_that_carry():
    """Random QPs with rows twice, their known solutions blurred to five digits: the conditions hold to rounding again."""
    rng = np.random.default_rng(3)
    count, size, rows, slacks, equal = 50, 8, 12, 2, 2
    x = np.concatenate([rng.normal(size=(count, size - slacks)), np.tile([0.0, 0.3], (count, 1))], axis=1)
    A = rng.normal(size=(count, rows, size))
    A[:, 1] = A[:, 0]  # two rows that share a load
    carries = rng.random((count, rows)) < 0.3
    carries[:, :2], carries[:, -equal:] = True, True
    lam = np.where(carries, rng.uniform(0.5, 2, (count, rows)), 0) * np.where(np.arange(rows) < rows - equal, 1, -1)
    lower = np.einsum("kij,kj->ki", A, x) - np.where(carries, 0, rng.uniform(0.5, 1, (count, rows)))
    bound = np.zeros((count, size))
    bound[:, -2] = 0.7  # the first slack is held at zero, the second one is open
    H = np.eye(size) + np.zeros((count, 1, 1))
    g = -x + np.einsum("kij,ki->kj", A, lam) + bound
    problem = {"h": H, "g": g, "a": A, "lba": lower}
    known = {"x": x, "lam_a": -lam, "lam_x": -bound}
    blurred = {name: values * (1 + 1e-5 * rng.normal(size=values.shape)) for name, values in known.items()}
    order = rng.permutation(size - slacks + rows)
    active = ActiveSet.of_answer(problem, blurred, equal, slacks)
    y, lam_a, lam_x = active.answer(problem, order).values()
    assert np.abs(y - x).max() < 1e-9
    assert np.abs(np.einsum("kij,kj->ki", H, y) + g + np.einsum("kij,ki->kj", A, lam_a) + lam_x).max() < 1e-10
    assert np.abs((np.einsum("kij,kj->ki", A, y) - lower)[carries]).max() < 1e-10


def test_flat_faces_have_points_where_their_rims_cross():
    """A bar across a bar: the corners of the square in which they lie over each other; and a small plate under a large one."""
    a = tc.Assembly("cross")
    beam = a.part("beam", tc.Box(100, 10, 10), at=(0, 45, -10), fixed=True)
    bar = a.part("bar", tc.Box(10, 100, 10), at=(45, 0, 0))
    foot = a.part("foot", tc.Box(3, 3, 3), at=(80, 48, -13), fixed=True)
    a.locate(bar, tc.three_two_one(bar.face("-z"), bar.face("-y"), bar.face("-x"), inset=1), tolerance=1)
    a.locate(beam, tc.three_two_one(beam.face("-z"), beam.face("-y"), beam.face("-x"), inset=1), tolerance=0)
    a.contact("across", moving=bar.face("-z"), reference=beam.face("+z"))
    a.contact("told", moving=bar.face("-z"), reference=beam.face("+z"), points=200)
    a.measure("z", bar.point(0, 0, 0), along="z", tolerance=1)
    across, said = discretize(a).pairs
    corners = {(45.0, 45.0, 0.0), (45.0, 55.0, 0.0), (55.0, 45.0, 0.0), (55.0, 55.0, 0.0)}
    assert corners <= {tuple(p) for p in across.P_m.round(9)}
    assert not corners <= {tuple(p) for p in said.P_m.round(9)}  # points that were asked for are left as they are
    below = overlap_corners(_patch_of(beam, "-z"), _patch_of(foot, "+z"))
    assert {tuple(p) for p in below.round(9)} == {(x, y, -10.0) for x in (80.0, 83.0) for y in (48.0, 51.0)}


def _patch_of(part, direction):
    mesh = shape(part.geometry)
    return patch(part.face(direction), {part: mesh}).placed(np.eye(3), np.array(part.at))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 20, *nightly(*(seed for seed in range(2, 60, 2) if seed != 20))])
def test_nothing_contradicts_a_certificate(seed):
    """Random scenes: see studies/certificates, which judges many more."""
    runs = []
    for solver in SOLVERS:
        assembly, method = scene(seed)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", r"\[coarse\]", tc.NominalWarning)
            try:
                program, run = simulate(assembly, samples=30, solver=solver, method=method)
            except tc.TolcontactError as error:
                pytest.skip(f"the scene is refused: {error}")
        assert not +contradictions(program, run)
        runs.append(run)
    both = np.isin(runs[0]["status"], [0, 1]) & np.isin(runs[1]["status"], [0, 1])
    size = max(part.mesh.scale for part in program.nominal.parts)
    assert np.abs(runs[0]["measured"] - runs[1]["measured"])[both].max(initial=0) < 1e-5 * size
