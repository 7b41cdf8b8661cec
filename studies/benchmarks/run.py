"""Solve the problems with tolcontact: python -m studies.benchmarks.run [NAMES]; with --write, the README gets the tables.

The exit code is 1 if an expected value lies outside of what was computed, or if an interval is too wide to say so.
"""

import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from studies.benchmarks.answers import Estimate
from studies.benchmarks.problem import Problem, Quantity, problems
from tolcontact.errors import NominalWarning

COLUMNS = ("quantity", "expected", "computed", "interval", "verdict")
AGREES, DIFFERS, TOO_WIDE, UNSUPPORTED = "agrees", "DIFFERS", "interval too wide", "not supported"
WORST_FIRST = [DIFFERS, TOO_WIDE, UNSUPPORTED, AGREES]
WIDEST = 2.0  # upper over lower bound of a probability: an agreement needs a narrower interval
README, BEGIN, END = Path(__file__).with_name("README.md"), "<!-- written by run.py --write -->\n", "<!-- end -->\n"


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
        _, lower, upper = self.estimate
        if not lower - tolerance <= expected <= upper + tolerance:
            return DIFFERS
        is_probability = expected > 0 and any(word in self.quantity.name for word in ("probability", "share"))
        return TOO_WIDE if is_probability and not upper < WIDEST * lower else AGREES

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
    def verdict(self) -> str:
        """The worst verdict of its figures."""
        return min((figure.verdict for figure in self.figures), key=WORST_FIRST.index)

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


def report(solutions: Sequence[Solved], console: Console) -> int:
    """Print a table of all figures, and return the exit code."""
    table = Table("problem", *COLUMNS, "CPU s", "realizations / s")
    for solution in solutions:
        for k, figure in enumerate(solution.figures):
            name, cost = (solution.problem.name, solution.cost) if k == 0 else ("", ["", ""])
            table.add_row(name, *figure.cells, *cost)
    console.print(table)
    verdicts = [solution.verdict for solution in solutions]
    counts = ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in WORST_FIRST if verdict in verdicts)
    console.print(f"{len(verdicts)} problems: {counts}")
    return int(DIFFERS in verdicts or TOO_WIDE in verdicts)


def row(solution: Solved) -> str:
    """Return the row of a problem in the table of the README: its first figure, its worst verdict, its cost."""
    quantity, *cells, _ = solution.figures[0].cells
    count = f" (of {len(solution.figures)})" if len(solution.figures) > 1 else ""
    return f"| {' | '.join([solution.problem.name, quantity + count, *cells, solution.verdict, *solution.cost])} |"


def rows(readme: Path = README) -> dict[str, str]:
    """Return the rows between the marks of the README by the names of problems."""
    table = readme.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]
    return {line.split("|")[1].strip(): line for line in table.splitlines() if line.startswith("| ")}


def write(solutions: Sequence[Solved], readme: Path = README) -> None:
    """Write the rows of these problems between the marks of the README; other rows stay."""
    lines = rows(readme) | {solution.problem.name: row(solution) for solution in solutions}
    stated = [problem for problem in problems() if problem.name in lines]
    sections = list(dict.fromkeys(problem.section for problem in stated))
    summary = ["| section | problems | agree |", "|---|---:|---:|"]
    table = ["| problem | quantity (first of n) | expected | computed | interval | verdict | CPU s | realizations / s |"]
    table.append("|---|---|---:|---:|---|---|---:|---:|")
    for section in sections:
        chosen = [lines[problem.name] for problem in stated if problem.section == section]
        summary.append(f"| {section} | {len(chosen)} | {sum(f'| {AGREES} |' in line for line in chosen)} |")
        table += [f"| **{section}** | | | | | | | |", *chosen]
    total = sum(f"| {AGREES} |" in lines[problem.name] for problem in stated)
    text = "\n".join([*summary, f"| all | {len(stated)} | {total} |", "", *table, ""])
    before, _, rest = readme.read_text(encoding="utf-8").partition(BEGIN)
    readme.write_text(f"{before}{BEGIN}{text}{END}{rest.partition(END)[2]}", encoding="utf-8")


def solutions_of(selection: Sequence[Problem]) -> list[Solved]:
    """Solve problems, and print the verdict of each to the terminal."""
    solutions = []
    for problem in selection:
        solutions.append(solved(problem))
        print(f"{problem.name}: {solutions[-1].verdict}", file=sys.stderr)
    return solutions


def main() -> int:
    """Report on the problems of the command line."""
    warnings.simplefilter("ignore", NominalWarning)  # faces of a problem may stand in each other, and tolerances be wide
    is_written = "--write" in sys.argv
    solutions = solutions_of(problems([name for name in sys.argv[1:] if name != "--write"]))
    if is_written:
        write(solutions)
    return report(solutions, Console(width=200))


if __name__ == "__main__":
    sys.exit(main())
