"""CasADi's conic plugins as solvers of contact QPs."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.compilation.conditioning import SOLUTION
from tolcontact.compilation.contact_qp import ContactQP
from tolcontact.compilation.functions import InterpretedFunction
from tolcontact.compilation.solver import Arrays, SolverChoice
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
        if not self.remembers:
            solved, failed = solve(inputs)
            return {name: solved[i] for name, i in zip(SOLUTION, results, strict=True)}, failed
        violated = problem["lba"][:, : reactions.shape[1]]
        likely = np.where(reactions.any(axis=1, keepdims=True), reactions, violated) > 0
        order = np.lexsort(np.packbits(likely, axis=1).T)
        solved, failed = solve([array[order] for array in inputs])
        back = np.argsort(order)
        return {name: solved[i][back] for name, i in zip(SOLUTION, results, strict=True)}, failed[back]

    def twin(self) -> "ConicSolver":
        """Return an equal solver with a new memory."""
        return ConicSolver(self._plugin, self._qp)
