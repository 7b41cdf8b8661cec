"""The QP solvers: CasADi plugins with their options, this package's solver, and the reasons to refuse others."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.errors import OptionError

ACCURACY = 1e-8  # mm: the largest KKT residual of a solved QP, for every plugin


@dataclass(frozen=True)
class Plugin:
    """A conic plugin of CasADi, or the solver of this package.

    is_conic    whether it is a plugin of CasADi; if not, it is a GraphSolver
    options     its options in CasADi
    springs     options that replace `options` for QPs with compliant rows
    fallbacks   names of the plugins that answer in its place, tried in order, if its answer misses ACCURACY
    remembers   whether it starts each problem from the previous answer
    """

    name: str
    options: dict[str, Any] = field(default_factory=dict)
    springs: dict[str, Any] = field(default_factory=dict)
    fallbacks: tuple[str, ...] = ("qpoases", "daqp")
    remembers: bool = False
    is_conic: bool = True


QPOASES = {
    "printLevel": "none",
    "terminationTolerance": 1e-14,
    "boundTolerance": 1e-14,
    "enableNZCTests": False,  # they take a tenth of its time; the residual reveals nonconvex problems just as well
}
DAQP = {"primal_tol": 1e-12, "dual_tol": 1e-13}
PLUGINS = {
    plugin.name: plugin
    for plugin in (
        # Rarely (about 1e-5 of all problems) it does not converge from the previous problem; with a new memory it succeeds.
        Plugin("qpoases", QPOASES, remembers=True),
        Plugin(
            "osqp",
            {"osqp": {"verbose": False, "eps_abs": 1e-10, "eps_rel": 1e-10, "max_iter": 50_000, "polishing": True}},
            remembers=True,
        ),
        # It cycles if rows contradict each other and two-sided locators are exact.
        # Parallel rows that differ only by stiff springs are not dependent: its default limit of 1e-11 would drop some.
        Plugin("daqp", {"daqp": DAQP}, {"daqp": {**DAQP, "zero_tol": 1e-15}}, fallbacks=("qpoases",)),
        Plugin("graph", fallbacks=("daqp", "qpoases"), is_conic=False),
        Plugin("piqp", {"piqp": {"eps_abs": 1e-12, "eps_rel": 1e-12}}),
        Plugin("highs", {"highs": {"output_flag": False}}, remembers=True),
        Plugin("proxqp", {"proxqp": {"backend": "dense", "eps_abs": 1e-11, "eps_rel": 0.0, "max_iter": 10_000}}),
        Plugin("gurobi"),
        Plugin("cplex"),
        Plugin("mosek"),
        Plugin("xpress"),
    )
}
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


def plugin(name: str) -> Plugin:
    """Return the table's entry for `name`, after it has solved a small problem correctly.

    Raises OptionError for a solver that is unknown, refused, not installed, or answers wrongly.
    """
    if name in REFUSED:
        raise OptionError(f'solver "{name}" is refused: {REFUSED[name]}; choose one of: {", ".join(usable_plugins())}')
    if name not in PLUGINS:
        raise OptionError(f'unknown solver "{name}"; choose one of: {", ".join(usable_plugins())}')
    if not is_usable(name):
        raise OptionError(
            f'solver "{name}" is not installed with this CasADi, or does not solve a small test problem; '
            f"choose one of: {', '.join(usable_plugins())}"
        )
    return PLUGINS[name]


def usable_plugins() -> list[str]:
    """Return the names of the plugins that are installed and solve a small problem correctly."""
    return [name for name in PLUGINS if is_usable(name)]


def solver(plugin: Plugin, h: ca.Sparsity, a: ca.Sparsity, *, springs: bool = False) -> ca.Function:
    """Return a QP solver for these sparsities, with the plugin's options for `springs` if rows are compliant.

    It reports failure in its outputs, never by an exception.
    """
    options = plugin.options | (plugin.springs if springs else {})
    return ca.conic("qp", plugin.name, {"h": h, "a": a}, {**options, "error_on_fail": False})


def is_usable(name: str) -> bool:
    """Return whether the plugin loads and finds the solution (1, 1) of min x'x/2 subject to x1 + x2 >= 2."""
    if not PLUGINS[name].is_conic:
        return True
    if not ca.has_conic(name):
        return False
    try:
        qp = solver(PLUGINS[name], ca.Sparsity.dense(2, 2), ca.Sparsity.dense(1, 2))
        x = qp(h=ca.DM.eye(2), g=0, a=ca.DM([[1, 1]]), lba=2, uba=ca.inf, lbx=-ca.inf, ubx=ca.inf)["x"]
    except RuntimeError:  # CasADi's only exception: a vendor's library is missing, or the plugin fails on construction
        return False
    return bool(np.allclose(x.full().ravel(), 1.0, atol=1e-4))
