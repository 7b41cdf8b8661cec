"""Guide and README: their examples run."""

import doctest
import io
import re
import types
from pathlib import Path

import pytest
from rich.console import Console

import tolcontact as tc
from tolcontact.report import summary_text

README = Path(__file__).parents[1] / "README.md"
CHAPTERS = (
    "declaration", "geometry", "pmi", "features", "fasteners", "discretization", "variation", "mechanics",
    "interference", "compilation",
    "plausibility", "contact", "simulation", "statistics", "archive", "report", "plot", "workflow", "analyses", "cli",
)  # fmt: skip
GUIDE = Path(tc.__file__).parent / "guide"


def examples(text, name):
    """Return the examples between the fences of a Markdown text."""
    unfenced = re.sub("^```.*$", "", text, flags=re.MULTILINE)
    return doctest.DocTestParser().get_doctest(unfenced, {}, name, None, 0)


@pytest.mark.slow
@pytest.mark.parametrize("chapter", ["", *CHAPTERS])
def test_examples_of_the_guide_run(chapter):
    text = (GUIDE / f"{chapter}.md").read_text(encoding="utf-8") if chapter else tc.__doc__
    test = examples(text, chapter)
    assert test.examples
    failures = []
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE).run(test, out=failures.append)
    assert not failures, "".join(failures)


def test_the_guide_has_no_other_chapters():
    assert {path.stem for path in GUIDE.iterdir()} == set(CHAPTERS)


def test_front_names_every_chapter_in_order():
    named = re.findall(r"^\| .* \| `tolcontact\.(\w+)` \|", tc.__doc__, re.MULTILINE)
    assert tuple(named) == CHAPTERS


def test_front_names_every_public_name():
    rows = re.findall(r"^\|(.*?)\|(.*?)\|$", tc.__doc__.partition("## Names")[2], re.MULTILINE)
    named, module = {"": {"__version__"}}, ""
    for purpose, names in rows[2:]:
        if purpose.strip():
            module = "".join(re.findall(r"`tc\.(\w+)`", purpose))
        named.setdefault(module, set()).update(re.findall(r"`(\w+)`", names))
    modules = {name for name in tc.__all__ if isinstance(getattr(tc, name), types.ModuleType)} - {"plot"}
    assert named.pop("") | modules == set(tc.__all__)
    assert set(named) == modules - {"declaration", "errors"}
    assert all(names == set(getattr(tc, module).__all__) for module, names in named.items())


def test_python_of_the_readme_runs_and_prints_its_table(tmp_path, monkeypatch, capsys):
    readme = README.read_text(encoding="utf-8")
    script, reading = re.findall(r"^```python\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)
    table = re.search(r"^```\n( +out of.*?)^```", readme, re.MULTILINE | re.DOTALL)[1]
    monkeypatch.chdir(tmp_path)
    Path("ra1.py").write_text(script)
    with tc.run("ra1.py", samples=1000, seed=1, out="ra1.nc") as results:
        console = Console(width=80, highlight=False, file=io.StringIO())
        console.print(summary_text(tc.summarize(results)))
    printed = {line.rstrip() for line in console.file.getvalue().splitlines()}
    assert set(table.splitlines()) <= printed
    names = {}
    exec(compile(reading, "README.md", "exec"), names)
    names["run"].close()
    assert "corner height" in capsys.readouterr().out


def test_readme_is_a_front():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 100


def test_links_of_the_readme_exist():
    links = re.findall(r"\]\(([^)#]+)\)", README.read_text(encoding="utf-8"))
    assert links
    assert not [link for link in links if not (README.parent / link).exists()]
