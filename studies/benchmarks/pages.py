"""Write a page for each problem, and a list of them: python -m studies.benchmarks.pages FOLDER [NAMES].

A page has the drawing, the statement with all numbers, the expected values, their source, what makes the problem hard, and the
script with the reference solutions and the model. Nothing is computed.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2
import markupsafe

from studies.benchmarks.drawing import svg
from studies.benchmarks.problem import FOLDER, SECTIONS, Problem, problems

HERE = Path(__file__).resolve().parent


def shown(problem: Problem) -> dict[str, Any]:
    """Return what a page shows of a problem."""
    script = FOLDER / f"{problem.name}.py"
    numbers = {name: f"{value:g}" if isinstance(value, float) else str(value) for name, value in problem.numbers.items()}
    return {
        "problem": problem,
        "drawing": markupsafe.Markup(svg(problem.drawing)),  # escaped by svg
        "numbers": numbers,
        "script": script.read_text(encoding="utf-8"),
    }


def write(folder: Path, selection: Sequence[Problem]) -> None:
    """Write the pages of problems into a folder, which is created if it is missing."""
    folder.mkdir(parents=True, exist_ok=True)
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(HERE), autoescape=True, trim_blocks=True)
    template = environment.get_template("page.html.j2")
    for problem in selection:
        page = template.render(title=problem.title, **shown(problem))
        (folder / f"{problem.name}.html").write_text(page, encoding="utf-8")
    sections = {section: [problem for problem in selection if problem.section == section] for section in SECTIONS}
    page = template.render(title="A benchmark of tolerance analysis", sections=sections)
    (folder / "index.html").write_text(page, encoding="utf-8")


def main() -> None:
    folder, *selection = sys.argv[1:] or sys.exit(str(__doc__).splitlines()[0])
    write(Path(folder), problems(selection))


if __name__ == "__main__":
    main()
