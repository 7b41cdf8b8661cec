"""The table of solvers: CasADi's plugins with their options, this package's own, and the reasons to refuse others.

A new solver is one entry. One of another kind is a class derived from SolverChoice, with an entry here.
"""

from tolcontact.compilation.conic_plugin import Plugin
from tolcontact.compilation.graph import GraphChoice
from tolcontact.compilation.solver import SolverChoice
from tolcontact.errors import OptionError

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
