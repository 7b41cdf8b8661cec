"""Compute every problem with a known answer again: python -m studies.verification.verify [C1 C4 ...]."""

import sys

from rich.console import Console
from rich.table import Table

from studies.verification.problems import PROBLEMS, Figure, Problem

COLUMNS = ("quantity", "expected", "from", "computed", "bounds", "verdict")


def row(figure: Figure) -> list[str]:
    """Return a figure as texts."""
    expected = f"{figure.expected:.6g}" if figure.expected == figure.expected else "-"
    half = (figure.upper - figure.lower) / 2
    is_narrow = half < 1e-4 * abs(figure.computed)
    bounds = f"+- {half:.1g}" if is_narrow else f"{figure.lower:.5g} to {figure.upper:.5g}"
    return [figure.quantity, expected, figure.source, f"{figure.computed:.6g}", bounds, figure.verdict]


def table(problem: Problem) -> Table:
    """All figures of a problem."""
    found = Table(*COLUMNS, title=f"{problem.number}: {problem.name}", title_justify="left")
    for figure in problem.figures():
        found.add_row(*row(figure))
    return found


def main() -> None:
    console = Console(width=120)
    for problem in PROBLEMS:
        if not sys.argv[1:] or problem.number in sys.argv[1:]:
            console.print(problem.text, table(problem), "")


if __name__ == "__main__":
    main()
