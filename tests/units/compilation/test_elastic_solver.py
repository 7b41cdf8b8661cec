"""The solver of QPs with elastic parts, against plugins that solve the same QPs with a column for each soft deformation."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from studies.elastic.measure import cover
from tests.cases import MODELS, elastic as cases
from tests.helpers import assembly_of, compiled, nightly
from tests.test_elastic_conflicts import SIDES, beam
from tests.test_elastic_parts import supported_beam, tips
from tests.units.compilation.test_dual_kernel import contact, solve
from tolcontact.compilation import ACCURACY
from tolcontact.compilation.functions import flat
from tolcontact.compilation.solvers import QPOASES, SOLVERS
from tolcontact.simulation import simulate_block
from tolcontact.vocabulary import Status


class Recorder:
    """The solver of a group, which keeps the QPs with its answers."""

    def __init__(self, solve, answers):
        self.solve, self.answers = solve, answers
        self.energy, self.relative, self.start_over = solve.energy, solve.relative, solve.start_over

    def __call__(self, **arrays):
        answer = self.solve(**arrays)
        self.answers.append(({name: values.copy() for name, values in arrays.items()}, answer))
        return answer

    def twin(self):
        return self


def steps(model, samples):
    """The steps of all stations: the group's QP, its inputs, and the answers of the solver in the reactions."""
    program, recorded, groups = compiled(model, solver="graph"), [], []
    for group in program.groups:
        recorded.append((group.qp, []))
        groups.append(replace(group, solve=Recorder(group.solve, recorded[-1][1])))
    block = simulate_block(replace(program, groups=tuple(groups)), program.draws(seed=1, start=0, stop=samples))
    assert (block.status == Status.RESOLVED).all() and not block.second_answers.any()
    return recorded


def solved_by(solver, qp, arrays):
    """The outputs of the QPs of a group, by a plugin alone."""
    inputs = {name: flat(values) for name, values in arrays.items()}
    problem = qp.evaluators.assemble(**inputs, bent=qp.flexibility.bent(inputs["reactions"] * inputs["newton"]))
    solution, failed = solver(problem, inputs["guess"], np.zeros((len(inputs["guess"]), qp.slacks)))
    assert not failed.any()
    size, multipliers = qp.assemble.size1_out("h"), solution["lam_a"]
    solution |= {"x": solution["x"][:, :size], "lam_x": solution["lam_x"][:, :size]}
    solution["bent"] = qp.flexibility.bent(-multipliers[:, : problem["length"].shape[1]] / problem["length"] * qp.scale)
    return qp.evaluators.finish(**inputs | problem | solution)


def inclined(folder):
    """The beam on three pairs of supports, in a turned frame, with a stiff spring in the middle."""
    return supported_beam(folder, 800.0, rotation=(0.4, 1.0, -0.7), at=(30, 200, -5))


def meshed(rows):
    """A plate with its own mesh, on a seat with form."""
    pytest.importorskip("ngsolve")
    return cover(rows)


SCENES = {
    "feet": lambda folder: beam(folder, range(6), *SIDES, one_sided=True),
    "n-2-1": lambda folder: beam(folder, range(6), *SIDES),
    "turned": inclined,
    "tips": tips,
    "welded sheets": lambda _: assembly_of(MODELS / "welded_sheets.py"),
    "flanges": lambda folder: cases.welded_sheets(folder, tolerance=0.5),
    "cover 38": lambda _: meshed(38),
    "cover 81": lambda _: meshed(81),
    "cover 153": lambda _: meshed(153),
}


QUICK = [("feet", "daqp"), ("turned", "daqp"), ("n-2-1", "qpoases"), ("tips", "qpoases"), ("welded sheets", "qpoases")]
SLOW = [("feet", "qpoases"), ("turned", "qpoases"), ("n-2-1", "daqp"), ("tips", "daqp"), ("flanges", "qpoases")]
SLOW += [(f"cover {rows}", plugin) for rows in (38, 81, 153) for plugin in ("daqp", "qpoases")]


@pytest.mark.parametrize(("scene", "plugin"), [*QUICK, *nightly(*SLOW)])
def test_poses_and_reactions_are_those_of_plugins(tmp_path, scene, plugin):
    """Plugins solve each QP with columns for C; daqp misses the accuracy on many QPs of welded sheets.

    At welded points, guns and contact share a reaction as they like: there, only what bends is compared.
    """
    for qp, answers in steps(SCENES[scene](tmp_path), 6):
        solver = SOLVERS[plugin].solver(qp)
        for arrays, answer in answers:
            expected = solved_by(solver, qp, arrays)
            assert expected["residual"].max() < ACCURACY
            assert expected["corrected"] == pytest.approx(answer["corrected"], abs=1e-9)
            reactions, others = answer["multipliers"], expected["multipliers"]
            assert qp.flexibility.bent(others) == pytest.approx(qp.flexibility.bent(reactions), abs=1e-9)
            if scene not in ("welded sheets", "flanges"):
                assert others == pytest.approx(reactions, abs=1e-6 * max(np.abs(others).max(), 1))


@pytest.mark.parametrize("plugin", ["daqp", "qpoases"])
@pytest.mark.parametrize("rows", [9, 38, *nightly(81)])
def test_random_flexibilities_have_the_answers_of_plugins(rows, plugin):
    """Gaps A x + C l + b, where plugins have columns L with L L' = C."""
    H, g, A, b, C, _ = problem = contact(rows, count=4, seed=5)
    x, reactions, _ = solve(problem)
    L = np.linalg.cholesky(C)
    wide = ca.Sparsity.dense(rows, 6 + rows)
    options = {"daqp": {"primal_tol": 1e-13, "dual_tol": 1e-13, "zero_tol": 1e-15}}
    conic = ca.conic(
        "qp", plugin, {"h": ca.Sparsity.dense(6 + rows, 6 + rows), "a": wide}, options if plugin == "daqp" else QPOASES
    )
    for k in range(4):
        whole = np.eye(6 + rows)
        whole[:6, :6] = H[k]
        answer = conic(h=whole, g=np.r_[g[k], np.zeros(rows)], a=np.hstack([A[k], L]), lba=-b[k], uba=np.inf)
        assert answer["x"].full()[:6, 0] == pytest.approx(x[k], abs=1e-9)
        assert -answer["lam_a"].full()[:, 0] == pytest.approx(reactions[k], abs=1e-6 * reactions[k].max())
