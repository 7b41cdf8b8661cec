"""The site: guide and reference from docstrings, a gallery of the models, and every problem of the benchmarks, computed anew.

python -m studies.site.build FOLDER [--samples N]
"""

import argparse
import ast
import inspect
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2
import markupsafe
import pdoc
from PIL import Image

import tolcontact as tc
from studies.benchmarks import pages
from studies.benchmarks.drawing import svg
from studies.benchmarks.problem import Problem, problems
from studies.benchmarks.run import COLUMNS, DIFFERS, UNSUPPORTED, solved
from tolcontact.report.html import summary_table, write_page
from tolcontact.report.html.page import HERE as REPORT

HERE = Path(__file__).resolve().parent
MODELS = HERE.parents[1] / "models"
LINES = 10  # of a model
PICTURE = (900, 600)  # pixels
# The front of the guide, the chapters that it lists (but those among its own names), and the assertions.
CHAPTERS = re.findall(r"\| `tolcontact\.(\w+)` \|", tc.__doc__ or "")
REFERENCE = ("tolcontact", *(f"tolcontact.{name}" for name in [*CHAPTERS, "testing"] if name not in dir(tc)))


def models() -> list[Path]:
    """Scripts that declare a model."""
    return [path for path in sorted(MODELS.glob("*.py")) if "def assembly(" in path.read_text(encoding="utf-8")]


def shown(path: Path, folder: Path, samples: int) -> dict[str, Any]:
    """Return the section of a model: its question, a picture, its first lines, and its answer."""
    text = path.read_text(encoding="utf-8")
    question, _, rest = (ast.get_docstring(ast.parse(text)) or "").partition("\n\n")
    results = tc.run(path, samples=samples, seed=1, solver="daqp")
    plotter = tc.plot.assembly(results, opacity=0.6)
    plotter.camera.zoom(1.3)
    picture = Image.fromarray(plotter.screenshot(None, return_img=True, window_size=PICTURE))
    picture.save(folder / f"{path.stem}.webp", quality=70)
    plotter.close()
    summary = results.tolcontact.summary()
    write_page(results, summary, folder / f"{path.stem}.html")
    body = text[text.index("def assembly(") :].splitlines()
    return {
        "name": path.stem,
        "question": question.replace("\n", " "),
        "text": rest.replace("\n", " "),
        "picture": f"{path.stem}.webp",
        "report": f"{path.stem}.html",
        "lines": "\n".join([*body[:LINES], "    ..."]),
        "answer": markupsafe.Markup(summary_table(summary)),
    }


def computed(problem: Problem) -> dict[str, Any]:
    """Return the section of a problem with its figures."""
    rows = [figure.cells for figure in solved(problem).figures]
    return {"problem": problem, "drawing": markupsafe.Markup(svg(problem.drawing)), "rows": rows}


def build(folder: Path, samples: int, scripts: Sequence[Path], chosen: Sequence[Problem]) -> None:
    """Write the pages of these models and problems into a folder, which is created if it is missing."""
    folder.mkdir(parents=True, exist_ok=True)
    pdoc.render.configure(show_source=False)
    for analysis in dir(tc.analyses):  # a module has the name of its function, until the function is asked for
        getattr(tc.analyses, analysis)
    pdoc.pdoc(*REFERENCE, output_directory=folder / "reference")
    pages.write(folder / "benchmarks", chosen)
    sections = [computed(problem) for problem in chosen]
    verdicts = [line[-1] for section in sections for line in section["rows"]]
    _write(
        folder / "verification.html", "Verification",
        f"{len(verdicts)} figures of {len(sections)} problems, computed anew by tolcontact {tc.__version__}: "
        f"{verdicts.count(DIFFERS)} differ from what is expected, and {verdicts.count(UNSUPPORTED)} are not supported. "
        "Intervals of estimates cover 99.9 % of runs; other intervals are tolerances.", problems=sections,
    )  # fmt: skip
    _write(
        folder / "gallery.html", "Gallery",
        f"What each model asks, and what {samples} realizations answer, without contact (raw) and with it (corrected).",
        models=[shown(path, folder, samples) for path in scripts],
    )  # fmt: skip
    _write(folder / "index.html", "tolcontact", (inspect.getdoc(tc) or "").partition("\n\n")[0])


def _write(path: Path, title: str, said: str, **things: Any) -> None:
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(HERE), autoescape=True)
    style = markupsafe.Markup((REPORT / "page.css").read_text(encoding="utf-8"))
    page = environment.get_template("pages.html.j2").render(title=title, said=said, style=style, columns=COLUMNS, **things)
    path.write_text(page, encoding="utf-8")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("folder", type=Path)
    options.add_argument("--samples", type=int, default=1000)
    chosen = options.parse_args()
    build(chosen.folder, chosen.samples, models(), problems())


if __name__ == "__main__":
    main()
