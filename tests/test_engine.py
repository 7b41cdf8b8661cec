"""The fast ways give what the plain ones give."""

import gc
import inspect
import itertools
from dataclasses import replace
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests import cases
from tests.helpers import nightly, recompiled
from tolcontact.code_cache import cache_folder
from tolcontact.compilation import contact_qp
from tolcontact.compilation.calls import inline
from tolcontact.compilation.functions import InterpretedFunction
from tolcontact.compilation.functions.named import MIN_COMPILED_CALLS
from tolcontact.compilation.functions.native import NativeFunction
from tolcontact.compilation.functions.operations import OPERATIONS
from tolcontact.compilation.functions.translation import UnknownInstructionError
from tolcontact.compilation.quadratic_terms import is_convex
from tolcontact.compilation.solvers import solver_choice
from tolcontact.contact import kernel
from tolcontact.contact.scan import PairScan, cluster_labels, pair_scan
from tolcontact.discretization import Offsets, discretize
from tolcontact.mechanics.gap import gap_map, gap_matrix
from tolcontact.mechanics.groups import contact_groups
from tolcontact.poses import AT_REST
from tolcontact.simulation import block_rows, simulate_block, simulate_blocks
from tolcontact.simulation.threads import MIN_ROWS
from tolcontact.variation import draw
from tolcontact.vocabulary import CORRECTED, RAW, Status

RNG = np.random.default_rng(5)
PLANAR = {"ra1": cases.ra1, "stack": cases.stack, "jaws": cases.jaws, "cover": lambda: cases.model("cover")}
EXACT = tc.Method(resolution="exact", objective="locator stiffness")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("stack", EXACT),
        ("stack", tc.Method()),
        *nightly(*((name, EXACT) for name in PLANAR if name != "stack")),
        *nightly(*((name, tc.Method()) for name in ("ra1", "jaws"))),
    ],
)
def test_compiled_functions_equal_interpreted_ones_to_the_last_bit(name, method):
    nominal = discretize(PLANAR[name]())
    for group in contact_groups(nominal, weighs_areas=method.is_exact):
        gaps = [gap_map(gap_matrix(pair), pair.offsets) for pair in nominal.pairs]
        qp = contact_qp.contact_qp(nominal, group, gaps, method)
        for function in (qp.assemble, qp.finish):
            inputs = [RNG.normal(size=(7, function.nnz_in(k))) for k in range(function.n_in())]
            for found, expected in zip(NativeFunction(function)(inputs), InterpretedFunction(function)(inputs)[0], strict=True):
                assert np.array_equal(found, expected, equal_nan=True)


def test_every_translated_instruction_does_what_casadi_does():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    values = [x + y, x - y, x * y, x / y, -x, x**2, 2 * x, 1 / x, ca.fmin(x, y), ca.fmax(x, y), x < y, x <= y, x == y, x != y]
    values += [ca.logic_not(x), ca.logic_and(x, y), ca.logic_or(x, y), ca.if_else(x > y, y, 0), ca.sqrt(x), ca.fabs(x)]
    values += [ca.sin(x), ca.cos(x), ca.exp(x), ca.log(x)]
    function = ca.Function("f", [x, y], [ca.vertcat(*values)])
    used = {function.instruction_id(k) for k in range(function.n_instructions())}
    assert set(OPERATIONS) - used <= {ca.OP_ASSIGN, ca.OP_FABS}
    special = np.array([0.0, -0.0, 1.0, -2.5, 1e300, np.inf, -np.inf, np.nan])
    grid = [each.reshape(-1, 1) for each in np.meshgrid(special, special)]
    found, expected = NativeFunction(function)(grid)[0], InterpretedFunction(function)(grid)[0][0]
    assert np.array_equal(found, expected, equal_nan=True)
    assert (np.signbit(found) == np.signbit(expected))[np.isfinite(expected)].all()


def test_a_compiled_call_does_what_casadi_does():
    x, y, z = ca.SX.sym("x", 3), ca.SX.sym("y"), ca.SX.sym("z", 30)
    inner = ca.Function("inner", [x, y], [ca.sin(x) * y, ca.sum1(x) + y])
    middle = ca.Function("middle", [x, y], inner.call(inner.call([x, y], False, True), False, True))
    rows = [middle.call([z[k : k + 3], z[k + 3] + 1.5], False, True) for k in range(0, 27, 3)]
    direct, _ = inner.call([z[:3], 0.25], False, True)
    function = ca.Function("outer", [z], [ca.vertcat(*itertools.chain(*rows)), direct * z[:3], z])
    inputs = [RNG.normal(size=(7, 30))]
    assert len(function.find_functions()) == 2
    for found, expected in zip(NativeFunction(function)(inputs), InterpretedFunction(function)(inputs)[0], strict=True):
        assert np.array_equal(found, expected)
    assert [len(result) for result in NativeFunction(function)([np.zeros((0, 30))])] == [0, 0, 0]
    with pytest.raises(ValueError, match="expected"):
        NativeFunction(function)([np.zeros((7, 29))])


def test_an_instruction_without_translation_is_left_to_casadi():
    x = ca.SX.sym("x")
    function = ca.Function("f", [x], [ca.erf(x)])
    with pytest.raises(UnknownInstructionError):
        NativeFunction(function)


EVERY = {"ra1": cases.ra1, "stack": cases.stack, "jaws": cases.jaws, "rollers": cases.rollers} | {
    name: lambda name=name: cases.model(name) for name in ("cover", "door", "cells", "channel", "tower", "ra2")
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "resolution"),
    [
        ("rollers", "exact"),
        ("stack", "exact"),
        ("jaws", "linearized"),
        *nightly(*((name, "exact") for name in EVERY if name not in ("rollers", "stack"))),
        *nightly(*((name, "linearized") for name in EVERY if name not in ("cover", "jaws"))),
    ],
)
def test_few_rows_give_what_all_rows_give(name, resolution):
    """Curved contact and several bodies included: the same QPs, once with the rows that are found, once with every row."""
    make = EVERY[name]
    few = tc.build(make(), solver="daqp", method=tc.Method(resolution=resolution, search="fixed"))
    every = recompiled(few, standing=[np.arange(len(pair.P_m)) for pair in few.nominal.pairs])
    assert any(len(g.qp.standing[0]) > 4 for g in every.groups)
    blocks = [next(simulate_blocks(program, samples=24, seed=8)) for program in (few, every)]
    assert (blocks[0].status == blocks[1].status).all()
    apart = np.abs(blocks[0].poses - blocks[1].poses).max(axis=(1, 2, 3))
    # mm; where rows contradict each other, multipliers of 1e6 leave rounding that much larger.
    assert apart.max() < (1e-10 if np.isin(blocks[0].status, [0, 1]).all() else 1e-5)


def test_only_corners_of_planar_contacts_can_be_the_deepest():
    (pair,) = discretize(cases.ra1()).pairs
    G = gap_matrix(pair)
    found = gap_map(G, pair.offsets)
    assert found.basis.shape == (13, 3) and len(found.corners) == 4
    assert np.abs(found.basis @ found.coordinates - G).max() < 1e-11
    X = np.hstack([Rotation.random(500, rng=1).as_matrix().reshape(500, 9), RNG.normal(size=(500, 3)), np.ones((500, 1))])
    gaps = X @ G
    assert np.abs(gaps.min(axis=1) - gaps[:, found.corners].min(axis=1)).max() < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["daqp", *nightly("qpoases", "highs")])
def test_results_do_not_depend_on_the_number_of_threads(solver, monkeypatch):
    program = tc.build(cases.model("channel"), solver=solver, method=tc.Method(resolution="exact"))
    runs = [list(simulate_blocks(program, samples=260, seed=1, block=40, threads=threads)) for threads in (1, 2, 5, 1)]
    for name in ("poses", "measured", "gap_min", "reaction", "kkt_residual", "status", "iterations"):
        one, *others = (np.concatenate([getattr(block, name) for block in run]) for run in runs)
        assert all(np.array_equal(one, other) for other in others), name


@pytest.mark.parametrize("make", [cases.ra1, cases.jaws], ids=["ra1", "jaws"])
def test_what_is_no_number_is_a_row_that_did_not_converge(make):
    program = tc.build(make(), solver="daqp")
    deviations = draw(program.nominal, seed=1, start=0, stop=9)
    expected = simulate_block(program, deviations)
    deviations[4, 0] = np.nan
    found = simulate_block(program, deviations)
    assert found.status[4] == Status.NOT_CONVERGED and found.kkt_residual[4] == np.inf
    others = np.arange(9) != 4
    assert np.array_equal(found.poses[others], expected.poses[others])


def test_functions_are_compiled_when_they_were_evaluated_often_and_nobody_notices(monkeypatch, tmp_path):
    gc.collect()  # programs of other tests store how often they were evaluated when they are collected
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))  # without the code of earlier processes
    program = tc.build(cases.ra1(), solver="daqp")
    first = next(simulate_blocks(program, samples=100, seed=1))
    assert not cache_folder().exists()
    for _ in simulate_blocks(program, samples=MIN_COMPILED_CALLS, seed=2):
        pass
    assert len(list(cache_folder().iterdir())) >= 2  # where parts are, and what is observed there
    last = next(simulate_blocks(program, samples=100, seed=1))
    assert np.array_equal(first.poses, last.poses) and np.array_equal(first.kkt_residual, last.kkt_residual)


@pytest.mark.slow
@pytest.mark.parametrize("activity", [0.3, *nightly(1e-9)])
@pytest.mark.parametrize(
    "make",
    [cases.ra1, cases.stack, lambda: cases.model("ra2"), cases.stopped, lambda: cases.stopped(2)],
    ids=["ra1", "stack", "ra2", "one stop", "two stops"],
)
def test_compiled_scans_equal_those_in_numpy(make, activity):
    program = tc.build(make(), solver="daqp")
    block = next(simulate_blocks(program, samples=50, seed=1))
    relative, later = (
        program.observe(poses=block.poses[:, state], deviations=block.deviations)["relative"].reshape(50, -1, 12)
        for state in (RAW, CORRECTED)
    )
    (group,) = program.groups
    for position, index in enumerate(group.group.pairs):
        tables = [side.table for side in group.group.sides if side.pair == position]
        compiled = pair_scan(program.nominal.pairs[index], program.gaps[index], tables, 6)
        plain = PairScan(**{name: getattr(compiled, name) for name in PairScan.__dataclass_fields__})
        (active, moments), expected = (
            scan.survey(relative[:, index], block.deviations, activity) for scan in (compiled, plain)
        )
        assert (active == expected[0]).all()
        assert np.allclose(moments, expected[1], rtol=1e-12, atol=1e-9)
        level = np.tile(AT_REST, (3, 1))  # all points of a flat face are as deep: the first one counts
        level[:, 9:] = -0.05 * program.nominal.pairs[index].n_r[0]
        for poses in (relative[:, index], later[:, index], level):
            assert (
                compiled.min_gap(poses, block.deviations[: len(poses)]) == plain.min_gap(poses, block.deviations[: len(poses)])
            ).all()
            for mask in (None, plain.gaps(relative[:, index], block.deviations)[: len(poses)] < activity):
                (points, depth), expected = (
                    scan.deepest(poses, block.deviations[: len(poses)], mask) for scan in (compiled, plain)
                )
                assert (points == expected[0]).all() and (depth == expected[1]).all()
        assert plain.deepest(relative[:, index], block.deviations)[1].max() > 0.01


@pytest.mark.parametrize(("offset", "tilt"), [(-1000.0, 1.0), (-0.5, 1e-3), (0.5, 1e-3)])
def test_no_gap_of_a_box_is_below_its_bound_in_spite_of_rounding(offset, tilt):
    rng = np.random.default_rng(3)
    lower, upper = np.sort(rng.normal(scale=50, size=(2, 1, 500)), axis=0)  # each box has points in both of its ends
    boxes, (middle, reach) = np.array([(upper + lower) / 2, (upper - lower) / 2]), np.empty((2, 500))
    for slope in tilt * rng.normal(size=20):
        kernel.bounds(boxes, 0, 500, np.array([offset, slope]), middle, reach)
        gaps = offset + slope * np.concatenate([lower, upper])
        assert (gaps >= middle - reach).all() and (gaps <= middle + reach).all()


@pytest.mark.parametrize(("coordinates", "corners"), [([[3.0, 1.0, 2.0, 5.0]], [1, 3]), ([], [0]), ([[2.0, 2.0]], [0])])
def test_on_a_line_the_two_ends_can_be_the_deepest(coordinates, corners):
    """Coordinates by which offsets raise the points, above a face on which all gaps are equal."""
    points = len(coordinates[0]) if coordinates else 3
    offsets = Offsets(np.arange(len(coordinates)), -np.array(coordinates).reshape(-1, points))
    assert gap_map(np.ones((13, points)), offsets).corners.tolist() == corners


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["daqp", "qpoases", *nightly("osqp", "highs", "piqp", "proxqp")])
def test_a_block_does_not_depend_on_those_before_it(solver):
    """Whatever a solver remembers of the last problems."""
    program = tc.build(cases.stack(), solver=solver, method=tc.Method(resolution="exact"))
    *_, last = simulate_blocks(program, samples=96, seed=4, block=32, threads=1)
    (alone,) = simulate_blocks(program, samples=96, seed=4, start=64, block=32)
    assert (last.status == Status.RESOLVED).any()
    assert np.array_equal(last.poses, alone.poses) and np.array_equal(last.reaction, alone.reaction)


@pytest.mark.parametrize(
    ("solver", "bodies", "rows"),
    [
        *(("daqp", *sizes) for sizes in [(0, 4096), (1, 4096), (24, 4096), (25, 2048), (48, 512), (100, 32), (1000, MIN_ROWS)]),
        *(("graph", *sizes) for sizes in [(0, 4096), (24, 4096), (25, 2048), (100, 512), (1000, 64)]),
    ],
)
def test_a_block_of_many_bodies_has_fewer_rows(solver, bodies, rows):
    """Its rows times the cube of its bodies, or the bodies with a solver that follows their graph, are those of 24 at most."""
    group, growth = SimpleNamespace(group=SimpleNamespace(free=range(bodies))), 1 if solver == "graph" else 3
    groups = [group] if bodies else []
    program = SimpleNamespace(groups=groups, solver=solver_choice(solver), method=SimpleNamespace(is_exact=False))
    block = inspect.unwrap(block_rows)(program)
    assert block == rows
    assert block * bodies**growth <= 4096 * 24**growth or block == MIN_ROWS


def test_one_curved_group_is_enough_for_small_blocks():
    a = cases.rollers()
    base = a.part("base", tc.Box(10, 10, 10), at=(50, 0, 0), fixed=True)
    top = a.part("top", tc.Box(10, 10, 10), at=(50, 0, 10))
    a.locate(top, tc.three_two_one(top.face("-z"), top.face("-y"), top.face("-x")), tolerance=0.1)
    a.contact("flat", moving=top.face("-z"), reference=base.face("+z"))
    exact, linearized = (tc.build(a, method=tc.Method(resolution=resolution)) for resolution in ("exact", "linearized"))
    curved, flat = exact.groups
    for groups, rows in ([curved, flat], 512), ([flat, curved], 512), ([flat], 4096):
        assert block_rows(replace(exact, groups=tuple(groups))) == rows
    assert block_rows(linearized) == 4096


def test_clusters_are_neighbours():
    """Four heaps far from each other, of points in any order."""
    rng = np.random.default_rng(1)
    heap = rng.integers(4, size=200)
    points = 100 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, -1, 1]])[heap] + rng.normal(size=(200, 3))
    label = cluster_labels(points, 4)
    assert sorted({(a, b) for a, b in zip(heap, label, strict=True)}) == sorted(dict(zip(heap, label, strict=True)).items())
    assert sorted(set(label)) == [0, 1, 2, 3]


def test_curvature_counts_only_where_every_block_is_positive_definite():
    Q = ca.SX.sym("Q", 12, 12)
    convex = ca.Function("convex", [Q], [is_convex(Q, inline)])
    one = np.eye(12)
    for k, value in itertools.product(range(12), (-1.0, 0.0, np.nan)):
        other = one.copy()
        other[k, k] = value
        assert not convex(other)
    other = one + 0.1
    other[:6, 6:] = other[6:, :6] = 100.0  # freedoms of several together are not looked at
    assert convex(one) and convex(other)
