"""The site: guide, reference of public names, a gallery of the models, and every problem of the benchmarks, computed anew.

python -m studies.site.build FOLDER [--samples N]     needs the extras docs, plot and step
"""

import argparse
import ast
import re
import shutil
import tempfile
import types
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from PIL import Image
from sphinx.cmd.build import build_main

import tolcontact as tc
from studies.benchmarks import pages
from studies.benchmarks.drawing import svg
from studies.benchmarks.problem import Problem, problems
from studies.benchmarks.run import COLUMNS, DIFFERS, UNSUPPORTED, solved
from tolcontact.report.html import summary_table, write_page

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
GUIDE, MODELS = ROOT / "tolcontact" / "guide", ROOT / "models"
LINES = 10  # of a model
PICTURE = (900, 600)  # pixels


def models() -> list[Path]:
    """Scripts that declare a model."""
    return [path for path in sorted(MODELS.glob("*.py")) if "def assembly(" in path.read_text(encoding="utf-8")]


def section_of_model(path: Path, source: Path, extra: Path, samples: int) -> str:
    """Return the section of a model: its question, a picture, its first lines, and its answer."""
    text = path.read_text(encoding="utf-8")
    question, _, rest = (ast.get_docstring(ast.parse(text)) or "").partition("\n\n")
    results = tc.run(path, samples=samples, seed=1, solver="daqp")
    plotter = tc.plot.assembly(results, opacity=0.6)
    plotter.camera.zoom(1.3)
    picture = Image.fromarray(plotter.screenshot(None, return_img=True, window_size=PICTURE))
    picture.save(source / f"{path.stem}.webp", quality=70)
    plotter.close()
    summary = results.tolcontact.summary()
    write_page(results, summary, extra / f"{path.stem}.html")
    lines = "\n".join([*text[text.index("def assembly(") :].splitlines()[:LINES], "    ..."])
    return "\n\n".join([
        "## " + question.replace("\n", " "),
        f"`models/{path.stem}.py`, <a href=\"{path.stem}.html\">live report</a>",
        rest.replace("\n", " ").replace("$", "\\$"),
        f"![The assembly {path.stem} with its locators, contact points and measurements]({path.stem}.webp)",
        f"```python\n{lines}\n```",
        f"<div class=\"wide\">\n{summary_table(summary)}\n</div>".replace("\n\n", "\n"),
    ])  # fmt: skip


def section_of_problem(problem: Problem, rows: Sequence[Sequence[str]]) -> str:
    """Return the section of a problem with its figures."""
    table = [COLUMNS, ["---"] * len(COLUMNS), *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n\n".join([
        f"## {problem.title}",
        svg(problem.drawing),
        f"{problem.text} <a href=\"benchmarks/{problem.name}.html\">Reference solutions and model</a>",
        "\n".join("| " + " | ".join(row) + " |" for row in table),
    ])  # fmt: skip


def reference() -> str:
    """Return the page of all public names, by the tables of the front page of the package."""
    entries = re.findall(r"^\|(.*?)\|(.*?)\|$", (tc.__doc__ or "").partition("## Names")[2], re.MULTILINE)[2:]
    lines, module = ["# Names"], ""
    for purpose, names in entries:
        if purpose.strip():
            module = "".join(f".{name}" for name in re.findall(r"`tc\.(\w+)`", purpose))
            lines.append("## " + purpose.strip().capitalize())
        for name in re.findall(r"`(\w+)`", names):
            thing = getattr(eval(f"tc{module}", {"tc": tc}), name)
            if isinstance(thing, types.ModuleType):
                continue
            kind = "class" if isinstance(thing, type) else "function"
            members = "\n   :members:\n   :inherited-members: Exception, tuple, Enum, IntEnum, int" if kind == "class" else ""
            lines.append(f"```{{eval-rst}}\n.. auto{kind}:: tolcontact{module}.{name}{members}\n```")
    return "\n\n".join(lines)


def front(names: Sequence[str]) -> str:
    """Return the front of the guide, with the pages that each section links in its side bar."""
    text = (GUIDE / "index.md").read_text(encoding="utf-8")
    title, *sections = re.split(r"^## ", text, flags=re.MULTILINE)
    result = [title]
    for section in sections:
        heading = section.partition("\n")[0]
        links = [link.removesuffix(".md") for link in re.findall(r"\]\(([^)]+\.md)\)", section)]
        if heading == "Reference":
            links = [*links, *names]
        result.append(f"{section}\n```{{toctree}}\n:hidden:\n:caption: {heading}\n\n" + "\n".join(links) + "\n```\n")
    others = "gallery\nverification\nchanges"
    return "## ".join(result) + f"\n```{{toctree}}\n:hidden:\n:caption: Evidence\n\n{others}\n```\n"


def changes() -> str:
    """Return the changes that the README lists."""
    section = (ROOT / "README.md").read_text(encoding="utf-8").partition("\n## Changes\n")[2].partition("\n## ")[0]
    return f"# Changes\n\n{section}"


def broken_links(folder: Path) -> list[str]:
    """Return the relative links of all pages in a folder whose file or anchor does not exist."""
    texts = {path.resolve(): path.read_text(encoding="utf-8") for path in folder.rglob("*.html")}
    anchors = {path: set(re.findall(r'\b(?:id|name)="([^"]+)"', text)) for path, text in texts.items()}
    broken = []
    for path, text in texts.items():
        for link in re.findall(r'<(?:a|img|link|script)\b[^>]*?\b(?:href|src)="([^"]*)"', text):
            url = urlsplit(link)
            target = (path.parent / unquote(url.path)).resolve() if url.path else path
            is_there = target.exists() and (
                not url.fragment or target not in anchors or unquote(url.fragment) in anchors[target]
            )
            if not (url.scheme or url.netloc or is_there):
                broken.append(f"{path.relative_to(folder.resolve())}: {link}")
    return broken


def build(folder: Path, samples: int, scripts: Sequence[Path], chosen: Sequence[Problem]) -> None:
    """Write the site of these models and problems into a folder. Raises RuntimeError if Sphinx warns or a link is broken."""
    with tempfile.TemporaryDirectory() as temporary:
        source, extra = Path(temporary) / "source", Path(temporary) / "extra"
        shutil.copytree(GUIDE, source)
        (source / "_static").mkdir()
        (extra / "benchmarks").mkdir(parents=True)
        shutil.copy(HERE / "site.css", source / "_static")
        shutil.copy(HERE / "conf.py", source)
        pages.write(extra / "benchmarks", chosen)
        figures = [[figure.cells for figure in solved(problem).figures] for problem in chosen]
        verdicts = [row[-1] for rows in figures for row in rows]
        written: dict[str, list[str]] = {
            "verification": [
                "# Verification",
                f"{len(verdicts)} figures of {len(chosen)} problems, computed anew by tolcontact {tc.__version__}: "
                f"{verdicts.count(DIFFERS)} differ from what is expected, and {verdicts.count(UNSUPPORTED)} are not supported. "
                "Intervals of estimates cover 99.9 % of runs; other intervals are tolerances.",
                *(section_of_problem(problem, rows) for problem, rows in zip(chosen, figures, strict=True)),
            ],
            "gallery": [
                "# Gallery",
                f"What each model asks, and what {samples} realizations answer, without contact (raw) and with it (corrected).",
                *(section_of_model(path, source, extra, samples) for path in scripts),
            ],
            "names": [reference()],
            "changes": [changes()],
            "index": [front(["names"])],
        }
        for name, sections in written.items():
            (source / f"{name}.md").write_text("\n\n".join(sections), encoding="utf-8")
        options: list[Any] = ["-q", "-W", "--keep-going", "-D", f"html_extra_path={extra}"]
        if build_main([str(option) for option in [*options, source, folder]]):
            raise RuntimeError("the site has warnings; see above")
    if broken := broken_links(folder):
        raise RuntimeError("links lead nowhere: " + ", ".join(broken))


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("folder", type=Path)
    options.add_argument("--samples", type=int, default=1000)
    chosen = options.parse_args()
    build(chosen.folder, chosen.samples, models(), problems())


if __name__ == "__main__":
    main()
