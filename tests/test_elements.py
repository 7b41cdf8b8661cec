"""A QP that is assembled from its elements is the QP of the whole group."""

from dataclasses import replace

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import EXACT, PAPER, ROOT, joined, nightly, simulate
from tolcontact.compilation import ContactGroup
from tolcontact.compilation.contact_qp import contact_qp
from tolcontact.compilation.contact_solver import ContactSolver
from tolcontact.compilation.elements import ElementQP
from tolcontact.simulation import simulate_blocks

ACCURACY = 1e-11  # mm: rounding of poses, over parts of some 100 mm
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


def both_ways(model, samples, method):
    """Runs of a model by the functions of whole groups, and by those of elements."""
    program, runs = tc.build(model, solver="daqp", method=method), []
    for build in (contact_qp, ElementQP):
        groups = []
        for group in program.groups:
            qp = build(program.nominal, group.group, program.gaps, program.method, program.plugin, group.qp.standing)
            groups.append(ContactGroup(group.group, qp, ContactSolver(qp)))
        runs.append(joined(simulate_blocks(replace(program, groups=tuple(groups)), samples=samples, seed=1)))
    return runs


@pytest.mark.parametrize(
    ("name", "method"),
    [
        (TOWER, None), (TOWER, PAPER), (CHANNEL, None), ("chain", EXACT), ("toleranced", EXACT), ("ra1", PAPER),
        *nightly((TOWER, CLOSED), (CELLS, None), (CELLS, PAPER), (CHANNEL, PAPER), (COVER, None)),
        *nightly(("chain", PAPER), ("ra1", EXACT)),
    ],
)  # fmt: skip
def test_elements_give_what_the_whole_function_gives(name, method):
    model = {"chain": cases.stack, "ra1": cases.ra1, "toleranced": lambda: tower(4, toleranced=True)}.get(name, lambda: name)()
    whole, elements = both_ways(model, 60, method)
    assert (whole["status"] == elements["status"]).all()
    assert (whole["iterations"] == elements["iterations"]).all()
    accuracy = WEAK_ACCURACY if method in (PAPER, CLOSED) else ACCURACY
    for quantity in ("poses", "measured", "gap_min"):
        assert np.abs(whole[quantity] - elements[quantity]).max() < accuracy, quantity


def test_blocks_of_realizations_do_not_change_a_bit():
    runs = [simulate(tower(6), samples=30, block=block, solver="daqp")[1] for block in (7, 1000)]
    for name, values in runs[0].items():
        assert np.array_equal(values, runs[1][name], equal_nan=True), name


def test_functions_are_shared_by_bodies_however_many():
    kinds = [tc.build(tower(blocks)).groups[0].qp.kinds for blocks in (6, 9)]
    assert kinds[0] == kinds[1] == 2  # a joint with the ground, and one between two blocks


def test_few_bodies_have_one_function():
    assert not isinstance(tc.build(tower(5)).groups[0].qp, ElementQP)
    assert isinstance(tc.build(tower(6)).groups[0].qp, ElementQP)
    seated = tower(6)
    seated.force("weight", at=seated.parts[-1].point(20, 20, 10), vector=(0, 0, -10))
    assert not isinstance(tc.build(seated, method=tc.Method(objective="seating")).groups[0].qp, ElementQP)
