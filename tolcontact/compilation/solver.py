"""What a solver of contact QPs is: its choice, declared once in the table of solvers, and its instances, one for each thread.

A solver takes the QPs that `assemble` of a ContactQP makes, many at once, and returns x with its multipliers. The solver does
not judge its answers; `finish` does.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from tolcontact.arrays import Array, Bool, Float
from tolcontact.compilation.contact_qp import ContactQP

ACCURACY = 1e-8  # mm: the largest KKT residual of a solved QP, for every solver

Arrays = Mapping[str, Float[Array, "_ _"]]  # by name, (realization, entry)


@runtime_checkable
class Solver(Protocol):
    """A solver of the QPs of one ContactQP, with its own memory. Threads must not share it.

    remembers   whether it starts each problem from the previous answer
    """

    @property
    def remembers(self) -> bool: ...

    def __call__(
        self, problem: Arrays, reactions: Float[Array, "realization row"], slacks: Float[Array, "realization slack"]
    ) -> tuple[dict[str, Float[Array, "realization _"]], Bool[Array, " realization"]]:
        """Return x, lam_a and lam_x of assembled QPs, (realization, entry), and (realization,) whether the solver failed.

        Probably, rows with `reactions` are active, and `slacks` above zero are open. A solver of elastic parts also returns
        `opened` (realization, row) [mm]: the penetration that it left to rows which contradict each other.
        """
        ...

    def twin(self) -> "Solver":
        """Return an equal solver with a new memory."""
        ...


@dataclass(frozen=True)
class SolverChoice(ABC):
    """A solver that a user can choose by its name, with all that the rest of the package asks about it.

    options     its options, which archives state
    fallbacks   names of the solvers that answer in its place, tried in order, if its answer misses ACCURACY
    remembers   whether it starts each problem from the previous answer
    growth      the time of a problem grows with this power of the number of coupled bodies
    """

    name: str
    options: dict[str, Any] = field(default_factory=dict)
    fallbacks: tuple[str, ...] = ("qpoases", "daqp", "piqp")
    remembers: bool = False
    growth: int = 3

    def substitutes(self, *, elastic: bool) -> tuple[str, ...]:
        """Return the names of the solvers that answer in its place: of `elastic` parts, "graph" is the first."""
        return self.fallbacks if not elastic or self.name == "graph" else ("graph", *self.fallbacks)

    @abstractmethod
    def is_usable(self) -> bool:
        """Return whether it is installed and solves a small problem correctly."""

    @abstractmethod
    def solver(self, qp: ContactQP) -> Solver:
        """Return a solver of the QPs of a group."""
