"""Solve the problems with tolcontact: python -m studies.benchmarks.run [NAMES].

The exit code is 1 if an expected value lies outside of what was computed.
"""

import sys
import time
import warnings
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from studies.benchmarks.answers import Estimate
from studies.benchmarks.problem import Problem, Quantity, problems
from tolcontact.errors import NominalWarning

COLUMNS = ("quantity", "expected", "computed", "interval", "verdict")
AGREES, DIFFERS, UNSUPPORTED = "agrees", "DIFFERS", "not supported"


class Figure(NamedTuple):
    """A quantity with what was computed for it; None if the problem is not supported."""

    quantity: Quantity
    estimate: Estimate | None

    @property
    def verdict(self) -> str:
        """Whether the expected value, give or take its tolerance, lies within the bounds."""
        if self.estimate is None:
            return UNSUPPORTED
        expected, tolerance = self.quantity.expected, self.quantity.tolerance
        return AGREES if self.estimate.lower - tolerance <= expected <= self.estimate.upper + tolerance else DIFFERS

    @property
    def cells(self) -> list[str]:
        """The texts of its row, in the order of COLUMNS."""
        expected = f"{self.quantity.expected:.6g}"
        if self.estimate is None:
            return [self.quantity.label, expected, "-", "-", self.verdict]
        value, lower, upper = self.estimate
        half = (upper - lower) / 2
        interval = f"± {half:.1g}" if half < 1e-4 * abs(value) or value == 0 else f"{lower:.5g} to {upper:.5g}"
        return [self.quantity.label, expected, f"{value:.6g}", interval, self.verdict]


class Solved(NamedTuple):
    """A problem with its figures, the processor time [s] with compilation, and the number of realizations."""

    problem: Problem
    figures: list[Figure]
    seconds: float
    realizations: int

    @property
    def cost(self) -> list[str]:
        """Texts of the processor time and of realizations per second."""
        if self.problem.unsupported:
            return ["-", "-"]
        return [f"{self.seconds:.1f}", f"{self.realizations / self.seconds:.0f}" if self.realizations else "-"]


def solved(problem: Problem) -> Solved:
    """Solve a problem. Raises ValueError if there is not one answer for each quantity."""
    if problem.unsupported:
        return Solved(problem, [Figure(quantity, None) for quantity in problem.quantities], 0.0, 0)
    start = time.process_time()
    estimates, realizations = problem.script.answers()
    seconds = time.process_time() - start
    if len(estimates) != len(problem.quantities):
        raise ValueError(f"{problem.name}: {len(estimates)} answers for {len(problem.quantities)} quantities")
    return Solved(problem, [*map(Figure, problem.quantities, estimates)], seconds, realizations)


def report(selection: list[Problem], console: Console) -> int:
    """Print a table of all figures, and return the exit code."""
    table = Table("problem", *COLUMNS, "CPU s", "realizations / s")
    verdicts: list[str] = []
    for problem in selection:
        solution = solved(problem)
        for k, figure in enumerate(solution.figures):
            table.add_row(*([problem.name] if k == 0 else [""]), *figure.cells, *(solution.cost if k == 0 else ["", ""]))
        verdicts.append(min((figure.verdict for figure in solution.figures), key=[DIFFERS, UNSUPPORTED, AGREES].index))
        print(f"{problem.name}: {verdicts[-1]}", file=sys.stderr)
    console.print(table)
    counts = ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in (AGREES, DIFFERS, UNSUPPORTED))
    console.print(f"{len(verdicts)} problems: {counts}")
    return int(DIFFERS in verdicts)


def main() -> int:
    """Report on the problems of the command line."""
    warnings.simplefilter("ignore", NominalWarning)  # faces of a problem may stand in each other, and tolerances be wide
    return report(problems(sys.argv[1:]), Console(width=150))


if __name__ == "__main__":
    sys.exit(main())
