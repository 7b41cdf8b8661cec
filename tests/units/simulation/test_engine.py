"""Insides of `simulation` under the claims of `tests/test_engine.py`."""

import inspect
from types import SimpleNamespace

import pytest

from tolcontact.compilation.solvers import solver_choice
from tolcontact.simulation import block_rows
from tolcontact.simulation.threads import MIN_ROWS


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
