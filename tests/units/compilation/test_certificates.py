"""Insides of `compilation` under the claims of `tests/test_certificates.py`."""

from dataclasses import replace

import numpy as np

from tests import cases
from tests.helpers import PAPER, joined, simulate
from tests.units.compilation.recompiling import recompiled
from tolcontact.compilation.active_set import active_set, solve_active
from tolcontact.compilation.solvers import Plugin
from tolcontact.simulation import simulate_blocks
from tolcontact.vocabulary import CORRECTED, RAW, Status


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
    active, is_open = active_set(problem, blurred, np.arange(rows - equal, rows), slacks)
    y, lam_a, lam_x = solve_active(problem, active, is_open, order).values()
    assert np.abs(y - x).max() < 1e-9
    assert np.abs(np.einsum("kij,kj->ki", H, y) + g + np.einsum("kij,ki->kj", A, lam_a) + lam_x).max() < 1e-10
    assert np.abs((np.einsum("kij,kj->ki", A, y) - lower)[carries]).max() < 1e-10
