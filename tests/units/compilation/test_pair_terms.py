"""A QP whose terms are summed over its pairs, in Functions that are called, is the QP of the whole group."""

import functools
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import EXACT, PAPER, ROOT, compiled, joined, nightly, simulate
from tolcontact.compilation import ContactGroup
from tolcontact.compilation.contact_qp import ENERGY_INPUTS, ContactQP, Evaluators, contact_qp
from tolcontact.compilation.contact_solver import ContactSolver
from tolcontact.compilation.qp_terms import FunctionCalls, inline
from tolcontact.simulation import simulate_blocks

ACCURACY = 1e-11  # mm: rounding of poses, over parts of some 100 mm
WHITENED_ACCURACY = 1e-8  # of QPs in the norm of the objective, which amplifies rounding where it holds freedoms weakly
WEAK_ACCURACY = 1e-8  # mm: of freedoms that only eta holds, where few points count
TOWER, CELLS, CHANNEL, COVER = (str(ROOT / "models" / f"{name}.py") for name in ("tower", "cells", "channel", "cover"))
CLOSED = tc.Method(resolution="exact", objective="active points")


def tower(blocks, *, toleranced=False):
    """A tower of blocks, one on the other; `toleranced`, their faces lean and lie off their places."""
    a = tc.Assembly("tower", method=tc.Method(resolution="exact", objective="all points"))
    below = a.part("block 0", tc.Box(40, 40, 10), fixed=True)
    for k in range(1, blocks + 1):
        block = a.part(f"block {k}", tc.Box(40, 40, 10), at=(0, 0, 10 * k), fixed=False)
        a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=4), tolerance=1)
        if toleranced:
            block.feature("A", block.face("-z"), datum="A")
            block.feature("top", block.face("+z"), tc.Profile(0.4, "A"), tc.Parallelism(0.1, "A"))
        a.contact(f"joint {k}", moving=block.face("-z"), reference=below.face("+z"), points=30)
        below = block
    a.measure("top", below.point(40, 40, 10), along="z", tolerance=1)
    return a


def pressed(blocks, kind):
    """A tower of blocks that are pressed down: on rigid faces, on springy locators beside them, or on springy faces.

    The second block is located on the first one. On rigid faces the third one is held where it is placed, by turns of any size,
    and does not touch the second one.
    """
    a = tc.Assembly(f"tower on {kind}", method=tc.Method(objective="seating"))
    below = a.part("base", tc.Box(60, 60, 10), at=(-10, -10, 0), fixed=True)
    for k in range(1, blocks + 1):
        is_placed = kind == "rigid faces" and k == 3
        block = a.part(f"block {k}", tc.Box(40, 40, 10), at=(0, 0, 10 * k + is_placed), fixed=False)
        sides = {"B1": (5, 0, 5, "y"), "B2": (35, 0, 5, "y"), "C": (0, 20, 5, "x")}
        feet = {"A1": (5, 5, 0), "A2": (35, 5, 0), "A3": (20, 35, 0)}
        scheme = [tc.Locator(name, place, along, 0.2) for name, (*place, along) in sides.items()]
        if kind == "springy locators":
            scheme += [tc.Locator(n, p, "z", 0.2, stiffness=500 + k, one_sided=n == "A1" and k == 1) for n, p in feet.items()]
        scheme += [tc.Locator(name, foot, "z", 0.2) for name, foot in feet.items() if is_placed]
        placing = {"placing": "exact"} if is_placed else {"floating": len(scheme) < 6}
        a.locate(block, scheme, on=below if k == 2 else None, **placing)
        block.feature("A", block.face("-z"), datum="A")
        block.feature("top", block.face("+z"), tc.Profile(0.1, "A"), tc.Parallelism(0.05, "A"))
        stiffness = 4000 + k if kind == "springy faces" else None
        a.contact(f"joint {k}", moving=block.face("-z"), reference=below.face("+z"), stiffness=stiffness, points=9)
        a.force(f"weight {k}", at=block.point(20 + k, 20, 5), vector=(0, 0, -10))
        below = block
    a.force("push", at=below.point(40, 20, 10), vector=(-1, 0.5, -3))
    a.measure("top", below.point(40, 40, 10), along="z", tolerance=1)
    return a


def dense(qp, name, stored):
    """All entries (realization, entry) of a matrix or a vector of a QP."""
    sparsity = qp.sparsity(name)
    entries = np.zeros((len(stored), sparsity.numel()))
    entries[:, sparsity.find()] = stored
    return entries


@dataclass(frozen=True, eq=False)
class RecordedQP(ContactQP):
    """The whole function, with the QPs of all calls: their inputs, matrices and solutions by name."""

    calls: list = field(default_factory=list)

    @property
    def evaluators(self):
        functions = super().evaluators

        def finish(**arrays):
            self.calls.append({name: values.copy() for name, values in arrays.items()})
            return functions.finish(**arrays)

        return Evaluators(functions.assemble, finish, functions.energy, functions.relate)


def qp_of(program, group, standing, *, is_summed):
    """The QP of a group of a program: summed over its pairs, or whole."""
    call = FunctionCalls() if is_summed else inline
    return contact_qp(program.nominal, group, program.method, standing, call)


def recorded(program, samples):
    """The whole function of a program with one group, after a run."""
    group = program.groups[0].group
    recorded_qp = RecordedQP(**vars(qp_of(program, group, program.groups[0].qp.standing, is_summed=False)))
    groups = (ContactGroup(group, recorded_qp, ContactSolver(recorded_qp, program.solver)),)
    list(simulate_blocks(replace(program, groups=groups), samples=samples, seed=1, threads=1))
    return recorded_qp


def both_ways(model, samples, method):
    """Runs of a model by the functions of whole groups, and by sums over pairs."""
    program, runs = compiled(model, solver="daqp", method=method), []
    for is_summed in (False, True):
        groups = []
        for group in program.groups:
            qp = qp_of(program, group.group, group.qp.standing, is_summed=is_summed)
            groups.append(ContactGroup(group.group, qp, ContactSolver(qp, program.solver)))
        runs.append(joined(simulate_blocks(replace(program, groups=tuple(groups)), samples=samples, seed=1)))
    return runs


@pytest.mark.parametrize(
    ("name", "method"),
    [
        (CHANNEL, None), ("chain", EXACT), ("toleranced", EXACT), ("ra1", PAPER),
        *nightly((TOWER, None), (TOWER, PAPER), (TOWER, CLOSED), (CELLS, None), (CELLS, PAPER), (CHANNEL, PAPER)),
        *nightly((COVER, None), ("chain", PAPER), ("ra1", EXACT)),
    ],
)  # fmt: skip
def test_sums_over_pairs_give_what_the_whole_function_gives(name, method):
    model = {"chain": cases.stack, "ra1": cases.ra1, "toleranced": lambda: tower(4, toleranced=True)}.get(name, lambda: name)()
    whole, summed = both_ways(model, 60, method)
    assert (whole["status"] == summed["status"]).all()
    assert (whole["iterations"] == summed["iterations"]).all()
    accuracy = WEAK_ACCURACY if method in (PAPER, CLOSED) else ACCURACY
    for quantity in ("poses", "measured", "gap_min"):
        assert np.abs(whole[quantity] - summed[quantity]).max() < accuracy, quantity


@pytest.mark.parametrize(
    ("name", "objective"),
    [
        *product(("rigid faces", "springy faces", "clutch"), ("seating",)), *nightly(("rigid faces", "locator stiffness")),
        *nightly(*product(("springy locators", "hinge", "spindle", "bracket"), ("seating",))),
    ],
)  # fmt: skip
def test_summed_functions_equal_the_functions_of_the_whole(name, objective):
    model = pressed(3, name) if name.endswith(("faces", "locators")) else cases.model(name)
    program = compiled(model, solver="daqp", method={"objective": objective})
    whole = recorded(program, 8)
    group = program.groups[0].group
    summed = qp_of(program, group, whole.standing, is_summed=True)
    assert called(summed) and not called(whole)
    for size in ("slacks", "equations", "has_springs"):
        assert getattr(summed, size) == getattr(whole, size)
    assert whole.calls
    for arrays in tuple(whole.calls):  # they are called again below
        problem = summed.evaluators.assemble(**arrays)
        for matrix in ("h", "g", "a", "lba"):
            expected, actual = dense(whole, matrix, arrays[matrix]), dense(summed, matrix, problem[matrix])
            assert np.abs(actual - expected).max() < WHITENED_ACCURACY * max(1, np.abs(expected).max()), matrix
        for function, inputs in (("finish", arrays | problem), ("energy", {n: arrays[n] for n in ENERGY_INPUTS})):
            expected, actual = (
                getattr(qp.evaluators, function)(**values) for qp, values in ((whole, arrays), (summed, inputs))
            )
            assert set(actual) == set(expected)
            for quantity, values in expected.items():
                accuracy = WHITENED_ACCURACY if quantity == "residual" else ACCURACY
                assert np.abs(actual[quantity] - values).max(initial=0) < accuracy * max(1, np.abs(values).max(initial=0)), (
                    quantity
                )


def test_blocks_of_realizations_do_not_change_a_bit():
    runs = [simulate(tower(6), samples=30, block=block, solver="daqp")[1] for block in (7, 1000)]
    for name, values in runs[0].items():
        assert np.array_equal(values, runs[1][name], equal_nan=True), name


def called(qp):
    """The names of the Functions that `assemble` calls."""
    return [function.name() for function in qp.assemble.find_functions(0)]


@functools.cache
def called_for_tower(blocks):
    return called(compiled(tower(blocks)).groups[0].qp)


def test_functions_are_shared_by_bodies_however_many():
    names = [called_for_tower(blocks) for blocks in (6, 9)]
    assert names[0] == names[1]
    assert names[0].count("pair_terms") == 2  # a joint with the ground, and one between two blocks
    # The first three joints differ, since the second block is located on the first one.
    names = [called(compiled(pressed(blocks, "springy faces")).groups[0].qp) for blocks in (6, 9)]
    assert names[0].count("pair_terms") == names[1].count("pair_terms") == 4


def test_few_bodies_have_one_function():
    assert not called_for_tower(5)
    assert called_for_tower(6)
    by_origin = tc.Method(objective="all points", regularization="identity")
    assert not called(compiled(tower(6), method=by_origin).groups[0].qp)
