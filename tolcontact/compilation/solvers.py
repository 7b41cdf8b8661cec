"""The table of solvers: CasADi's plugins with their options, this package's own, and the reasons to refuse others.

A new solver is one entry. One of another kind is a class derived from SolverChoice, with an entry here.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.compilation.conditioning import SOLUTION
from tolcontact.compilation.contact_qp import ContactQP
from tolcontact.compilation.functions import InterpretedFunction
from tolcontact.compilation.graph import GraphChoice
from tolcontact.compilation.solver import Arrays, SolverChoice
from tolcontact.errors import OptionError
from tolcontact.mechanics.quiet import CONSTRUCTION_LOCK, quiet

QP = ("h", "g", "a", "lba", "uba")  # outputs of `assemble` that a plugin needs


@dataclass(frozen=True)
class Plugin(SolverChoice):
    """A conic plugin of CasADi. `springs` are options that replace `options` for QPs with compliant rows."""

    springs: dict[str, Any] = field(default_factory=dict)

    def is_usable(self) -> bool:
        """Return whether the plugin loads and finds the solution (1, 1) of min x'x/2 subject to x1 + x2 >= 2."""
        if not ca.has_conic(self.name):
            return False
        try:
            qp = self.function(ca.Sparsity.dense(2, 2), ca.Sparsity.dense(1, 2))
            x = qp(h=ca.DM.eye(2), g=0, a=ca.DM([[1, 1]]), lba=2, uba=ca.inf, lbx=-ca.inf, ubx=ca.inf)["x"]
        except RuntimeError:  # CasADi's only exception: a library is missing, or the plugin fails on construction
            return False
        return bool(np.allclose(x.full().ravel(), 1.0, atol=1e-4))

    def function(self, h: ca.Sparsity, a: ca.Sparsity, *, springs: bool = False) -> ca.Function:
        """Return CasADi's Function that solves QPs of these sparsities, with the options for `springs` if rows are compliant.

        It reports failure in its outputs, never by an exception.
        """
        options = self.options | (self.springs if springs else {})
        return ca.conic("qp", self.name, {"h": h, "a": a}, {**options, "error_on_fail": False})

    def solver(self, qp: ContactQP) -> "ConicSolver":
        return ConicSolver(self, qp)


class ConicSolver:
    """The solver of a plugin for the QPs of a group."""

    def __init__(self, plugin: Plugin, qp: ContactQP) -> None:
        self._plugin, self._qp, self.remembers = plugin, qp, plugin.remembers

    @cached_property
    def _solve(self) -> tuple[InterpretedFunction, list[str], list[int]]:
        """The function of the plugin, the names of its inputs, and which of its outputs are results."""
        plugin, qp = self._plugin, self._qp
        with CONSTRUCTION_LOCK, quiet():
            conic = plugin.function(qp.sparsity("h"), qp.sparsity("a"), springs=qp.has_springs)
        lower_bounds = np.zeros(conic.numel_in("g"))
        lower_bounds[: -qp.slacks] = -np.inf
        lower_bounds[len(lower_bounds) - qp.free_slacks :] = -np.inf
        bounds = {"lbx": lower_bounds, "ubx": np.full(lower_bounds.shape, np.inf)}
        # The other inputs, initial guesses, are zero: no plugin uses them.
        fixed_inputs = {i: bounds.get(name, np.zeros(1)) for i, name in enumerate(conic.name_in()) if name not in QP}
        with CONSTRUCTION_LOCK, quiet():
            function = InterpretedFunction(conic, fixed_inputs)
        return function, [name for name in conic.name_in() if name in QP], [conic.name_out().index(name) for name in SOLUTION]

    def __call__(self, problem: Arrays, reactions: np.ndarray, slacks: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Return x, lam_a and lam_x of assembled QPs, (realization, entry), and (realization,) whether the plugin failed.

        A plugin that starts from the previous problem is faster if similar problems follow each other. So they are sorted by
        their probable active set: rows with `reactions` (realization, row), or in a first step violated rows.
        """
        solve, names, results = self._solve
        whole = self._qp.whole(problem)
        inputs = [whole[name] for name in names]
        order: Any = slice(None)
        if self.remembers:
            violated = problem["lba"][:, : reactions.shape[1]]
            likely = np.where(reactions.any(axis=1, keepdims=True), reactions, violated) > 0
            order = np.lexsort(np.packbits(likely, axis=1).T)
        solved, failed = solve([array[order] for array in inputs])
        back = np.argsort(order) if self.remembers else order
        return {name: solved[i][back] for name, i in zip(SOLUTION, results, strict=True)}, failed[back]

    def twin(self) -> "ConicSolver":
        """Return an equal solver with a new memory."""
        return ConicSolver(self._plugin, self._qp)


QPOASES = {
    "printLevel": "none",
    "terminationTolerance": 1e-14,
    "boundTolerance": 1e-14,
    "enableNZCTests": False,  # they take a tenth of its time; the residual reveals nonconvex problems just as well
}
OSQP = {"verbose": False, "eps_abs": 1e-10, "eps_rel": 1e-10, "max_iter": 50_000, "polishing": True}
DAQP = {"primal_tol": 1e-12, "dual_tol": 1e-13}
PROXQP = {"backend": "dense", "eps_abs": 1e-11, "eps_rel": 0.0, "max_iter": 10_000}
_CHOICES: tuple[SolverChoice, ...] = (
    # Rarely (about 1e-5 of all problems) it does not converge from the previous problem; with a new memory it succeeds.
    Plugin("qpoases", QPOASES, remembers=True),
    Plugin("osqp", {"osqp": OSQP}, remembers=True),
    # It cycles if rows contradict each other and two-sided locators are exact; there, qpOASES fails sometimes.
    # Parallel rows that differ only by stiff springs are not dependent: its default limit of 1e-11 would drop some.
    Plugin("daqp", {"daqp": DAQP}, fallbacks=("qpoases", "piqp"), springs={"daqp": {**DAQP, "zero_tol": 1e-15}}),
    GraphChoice("graph", fallbacks=("daqp", "qpoases", "piqp"), growth=1),
    Plugin("piqp", {"piqp": {"eps_abs": 1e-12, "eps_rel": 1e-12}}),
    Plugin("highs", {"highs": {"output_flag": False}}, remembers=True),
    Plugin("proxqp", {"proxqp": PROXQP}),
)
SOLVERS = {choice.name: choice for choice in _CHOICES}
REFUSED = {
    "ipqp": "its answers can be off by about 0.01 mm, with residuals that pass as solved",
    "superscs": "it reports success with wrong answers",
    "fatrop": "its cost output is always 0, and its assertions fail",
    "hpipm": "it only takes problems with the structure of optimal control",
    "qrqp": "it gives wrong answers, or hangs, with more than a few dozen rows",
    "clp": "it only solves linear programs",
    "cbc": "it only solves linear programs",
    "nlpsol": "it is an adapter for nonlinear solvers, which are too slow here",
}


def solver_choice(name: str) -> SolverChoice:
    """Return the table's entry for `name`, after it has solved a small problem correctly.

    Raises OptionError for a solver that is unknown, refused, not installed, or answers wrongly.
    """
    if name in REFUSED:
        raise OptionError(f'solver "{name}" is refused: {REFUSED[name]}; choose one of: {", ".join(usable_solvers())}')
    if name not in SOLVERS:
        raise OptionError(f'unknown solver "{name}"; choose one of: {", ".join(usable_solvers())}')
    if not SOLVERS[name].is_usable():
        raise OptionError(
            f'solver "{name}" is not installed with this CasADi, or does not solve a small test problem; '
            f"choose one of: {', '.join(usable_solvers())}"
        )
    return SOLVERS[name]


def usable_solvers() -> list[str]:
    """Return the names of the solvers that are installed and solve a small problem correctly."""
    return [name for name, choice in SOLVERS.items() if choice.is_usable()]
