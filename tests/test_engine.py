"""The fast ways give what the plain ones give."""

from dataclasses import replace

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import compiled, nightly
from tolcontact.simulation import block_rows, simulate_block, simulate_blocks
from tolcontact.variation import draw
from tolcontact.vocabulary import Status


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["daqp", *nightly("qpoases", "highs")])
def test_results_do_not_depend_on_the_number_of_threads(solver, monkeypatch):
    program = compiled(cases.model("channel"), solver=solver, method=tc.Method(resolution="exact"))
    runs = [list(simulate_blocks(program, samples=130, seed=1, block=20, threads=threads)) for threads in (1, 2, 5, 1)]
    for name in ("poses", "measured", "gap_min", "reaction", "kkt_residual", "status", "iterations"):
        one, *others = (np.concatenate([getattr(block, name) for block in run]) for run in runs)
        assert all(np.array_equal(one, other) for other in others), name


@pytest.mark.parametrize("make", [cases.ra1, cases.jaws], ids=["ra1", "jaws"])
def test_what_is_no_number_is_a_row_that_did_not_converge(make):
    program = compiled(make(), solver="daqp")
    deviations = draw(program.nominal, seed=1, start=0, stop=9)
    expected = simulate_block(program, deviations)
    deviations[4, 0] = np.nan
    found = simulate_block(program, deviations)
    assert found.status[4] == Status.NOT_CONVERGED and found.kkt_residual[4] == np.inf
    others = np.arange(9) != 4
    assert np.array_equal(found.poses[others], expected.poses[others])


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["daqp", "qpoases", *nightly("osqp", "highs", "piqp", "proxqp")])
def test_a_block_does_not_depend_on_those_before_it(solver):
    """Whatever a solver remembers of the last problems."""
    program = compiled(cases.stack(), solver=solver, method=tc.Method(resolution="exact"))
    *_, last = simulate_blocks(program, samples=96, seed=4, block=32, threads=1)
    (alone,) = simulate_blocks(program, samples=96, seed=4, start=64, block=32)
    assert (last.status == Status.RESOLVED).any()
    assert np.array_equal(last.poses, alone.poses) and np.array_equal(last.reaction, alone.reaction)


def test_one_curved_group_is_enough_for_small_blocks():
    a = cases.rollers()
    base = a.part("base", tc.Box(10, 10, 10), at=(50, 0, 0), fixed=True)
    top = a.part("top", tc.Box(10, 10, 10), at=(50, 0, 10))
    a.locate(top, tc.three_two_one(top.face("-z"), top.face("-y"), top.face("-x")), tolerance=0.1)
    a.contact("flat", moving=top.face("-z"), reference=base.face("+z"))
    exact, linearized = (compiled(a, method=tc.Method(resolution=resolution)) for resolution in ("exact", "linearized"))
    curved, flat = exact.groups
    for groups, rows in ([curved, flat], 512), ([flat, curved], 512), ([flat], 4096):
        assert block_rows(replace(exact, groups=tuple(groups))) == rows
    assert block_rows(linearized) == 4096
