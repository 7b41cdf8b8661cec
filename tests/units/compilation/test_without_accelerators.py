"""The definition alone: models have the same answers without anything that only saves time.

The plain program has one Function for each group, without calls of shared Functions. CasADi evaluates all Functions. A plugin
solves each QP from its data alone: no predicted active set, no previous problem, no graph of bodies. The test is also the
example of a solver that is added from outside: a choice with its solver, and nothing else.
"""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import compiled, nightly
from tolcontact.compilation import ContactGroup, NamedFunction
from tolcontact.compilation.contact_qp import ContactQP, Evaluators, contact_qp
from tolcontact.compilation.contact_solver import ContactSolver
from tolcontact.compilation.qp_terms import inline
from tolcontact.compilation.solver import SolverChoice
from tolcontact.compilation.solvers import SOLVERS
from tolcontact.mechanics import GapMap
from tolcontact.simulation import simulate_block

SOLUTION = ("x", "lam_a", "lam_x")


class Interpreted(NamedFunction):
    """A function that CasADi evaluates, one realization after the other."""

    calls = 0

    def __call__(self, **arrays):
        """Return the stored entries of all outputs, as NamedFunction does."""
        Interpreted.calls += 1
        inputs = [np.asarray(arrays[name], dtype=float) for name in self.names]
        outputs = [self.function.call([*map(self.argument, range(len(inputs)), rows)]) for rows in zip(*inputs, strict=True)]
        columns = zip(*outputs, strict=True) if outputs else ([] for _ in range(self.function.n_out()))
        sizes = map(self.function.nnz_out, range(self.function.n_out()))
        return {
            name: np.array([output.nonzeros() for output in column], dtype=float).reshape(len(inputs[0]), size)
            for name, column, size in zip(self.function.name_out(), columns, sizes, strict=True)
        }

    def argument(self, index, values):
        """An input from its stored entries in CasADi's order."""
        return ca.DM(self.function.sparsity_in(index), values.ravel())


class PlainQP(ContactQP):
    """A QP whose functions CasADi evaluates."""

    @property
    def evaluators(self):
        dense = (NamedFunction.dense(function).function for function in (self.energy, self.relate))
        return Evaluators(*map(Interpreted, (self.assemble, self.finish, *dense)))


@dataclass(frozen=True)
class OneByOne(SolverChoice):
    """A plugin that knows nothing of other realizations."""

    def is_usable(self):
        return True

    def solver(self, qp):
        return SingleSolver(SOLVERS["daqp"].function(qp.sparsity("h"), qp.sparsity("a"), springs=qp.has_springs), qp)


class SingleSolver:
    """A solver of one QP at a time."""

    remembers = False
    solved = 0

    def __init__(self, function, qp):
        self.function, self.qp = function, qp
        self.lower = np.zeros(qp.sparsity("h").size1())
        self.lower[: -qp.slacks] = -np.inf

    def __call__(self, problem, reactions, slacks):
        """Return the solutions and which of them failed."""
        SingleSolver.solved += len(reactions)
        answers, failed = [], []
        for k in range(len(reactions)):
            matrices = {name: ca.DM(self.qp.sparsity(name), problem[name][k]) for name in ("h", "g", "a", "lba", "uba")}
            answer = self.function(**matrices, lbx=self.lower, ubx=np.inf)
            answers.append([answer[name].full().ravel() for name in SOLUTION])
            failed.append(not self.function.stats()["success"])
        columns = [np.array(column) for column in zip(*answers, strict=True)]
        return dict(zip(SOLUTION, columns, strict=True)), np.array(failed)

    def twin(self):
        return self


def plain(program):
    """The same program without accelerators."""
    choice, groups = OneByOne("one by one", fallbacks=("qpoases",)), []
    for group in program.groups:
        qp = contact_qp(program.nominal, group.group, program.method, group.qp.standing, inline)
        qp = PlainQP(**vars(qp))
        groups.append(ContactGroup(group.group, qp, ContactSolver(qp, choice)))
    return replace(
        program,
        solver=choice,
        place=Interpreted(program.place.function),
        observe=Interpreted(program.observe.function),
        gaps=tuple(gaps if isinstance(gaps, GapMap) else Interpreted(gaps.function) for gaps in program.gaps),
        groups=tuple(groups),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "resolution", "solver", "accuracy"),
    [
        ("ra1", "linearized", "qpoases", 1e-11),
        ("ra1", "exact", "graph", 1e-11),
        ("channel", "exact", "graph", 1e-9),
        ("clutch", "exact", "qpoases", 1e-6),  # freedoms that only the regularization fixes
        *nightly(
            ("ra2", "linearized", "qpoases", 1e-11),
            ("lid", "exact", "qpoases", 1e-11),
            ("tower", "linearized", "graph", 1e-11),
            ("cells", "linearized", "graph", 1e-11),
            ("spindle", "exact", "qpoases", 1e-9),
            ("hinge", "exact", "graph", 1e-7),  # steps end when they are as small as the solver is accurate
        ),
    ],
)
def test_models_have_the_same_answers_without_accelerators(model, resolution, solver, accuracy):
    program = compiled(cases.model(model), solver=solver, method={"resolution": resolution})
    deviations = program.draws(seed=2, start=0, stop=12)
    fast = simulate_block(program, deviations)
    calls, solved = Interpreted.calls, SingleSolver.solved
    slow = simulate_block(plain(program), deviations)
    assert Interpreted.calls > calls + 4 and SingleSolver.solved > solved
    assert (fast.status == slow.status).all() and (fast.status == tc.Status.RESOLVED).any()
    assert np.abs(fast.poses - slow.poses).max() < accuracy
    assert np.abs(fast.measured - slow.measured).max() < accuracy
    assert np.abs(fast.gap_min - slow.gap_min).max() < accuracy
