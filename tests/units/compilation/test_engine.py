"""Insides of `compilation` under the claims of `tests/test_engine.py`."""

import gc
import itertools

import casadi as ca
import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import compiled, nightly
from tests.units.compilation.recompiling import recompiled
from tolcontact.code_cache import cache_folder
from tolcontact.compilation import contact_qp, qp_terms
from tolcontact.compilation.functions import InterpretedFunction
from tolcontact.compilation.functions.named import MIN_COMPILED_CALLS
from tolcontact.compilation.functions.native import NativeFunction
from tolcontact.compilation.functions.operations import OPERATIONS
from tolcontact.compilation.qp_terms import inline, is_convex
from tolcontact.discretization import discretize
from tolcontact.mechanics.groups import contact_groups
from tolcontact.mechanics.pair_gaps import pair_gaps
from tolcontact.simulation import simulate_blocks

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
    for group in contact_groups(nominal, method):
        pairs = [nominal.pairs[index] for index in group.pairs]
        standing = [qp_terms.standing_points(pair, pair_gaps(pair).compiled(nominal.input_count), method) for pair in pairs]
        qp = contact_qp.contact_qp(nominal, group, method, standing)
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
    with pytest.raises(NotImplementedError):
        NativeFunction(function)


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
    few = compiled(make(), solver="daqp", method=tc.Method(resolution=resolution, search="fixed"))
    every = recompiled(few, standing=[np.arange(len(pair.P_m)) for pair in few.nominal.pairs])
    assert any(len(g.qp.standing[0]) > 4 for g in every.groups)
    blocks = [next(simulate_blocks(program, samples=24, seed=8)) for program in (few, every)]
    assert (blocks[0].status == blocks[1].status).all()
    apart = np.abs(blocks[0].poses - blocks[1].poses).max(axis=(1, 2, 3))
    # mm; where rows contradict each other, multipliers of 1e6 leave rounding that much larger.
    assert apart.max() < (1e-10 if np.isin(blocks[0].status, [0, 1]).all() else 1e-5)
