"""Guide and README: their examples run."""

import doctest
import re
import runpy
import shlex
import shutil
import types
from pathlib import Path

import pytest

import tolcontact as tc
from tests.helpers import call
from tolcontact.report import write_guide

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
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


PAGES = sorted(str(path.relative_to(GUIDE)) for path in GUIDE.rglob("*.md") if path.stem not in CHAPTERS)
HEAVY = ("tutorials/bracket.md", "tutorials/seal.md")
NEEDED = {"tutorials/beam.md": "ngsolve"}


def fences(text):
    """Return the fenced blocks of a Markdown text: their languages and lines."""
    return re.findall(r"^```(\w+)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def run_command(words, expected):
    """Run a command of a page, and compare the lines that it prints with those of the page; "..." leaves lines out."""
    if words[0] == "python":
        runpy.run_path(words[1])
        return
    assert words[0] == "tolcontact"
    printed = [" ".join(line.split()) for line in call(".", *words[1:]).stdout.splitlines()]
    missing = [line for line in expected if line.strip() not in ("", "...") and " ".join(line.split()) not in printed]
    assert not missing, "\n".join([shlex.join(words), *missing, "but it prints", *printed])


def run_console(text):
    for command, output in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", text, re.MULTILINE):
        run_command(shlex.split(command), output.splitlines())


def run_page(text, folder, monkeypatch):
    """Run all blocks of a page in a folder: scripts, sessions and commands."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "78")
    (folder / "models").symlink_to(ROOT / "models")
    for file in (GUIDE / "files").iterdir():
        shutil.copy(file, folder)
    names, failures = {"__name__": "page"}, []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    for language, block in fences(text):
        first = block.partition("\n")[0]
        if language == "pycon":
            test = doctest.DocTestParser().get_doctest(block, names, "page", None, 0)
            runner.run(test, out=failures.append, clear_globs=False)
            names = test.globs
        elif language == "console":
            run_console(block)
        elif re.fullmatch(r"# from models/\w+\.py", first):
            model = (ROOT / first.removeprefix("# from ")).read_text(encoding="utf-8")
            excerpt = [line.strip() for line in block.splitlines()[1:] if line.strip() not in ("", "...")]
            assert not [line for line in excerpt if line not in [of_model.strip() for of_model in model.splitlines()]]
        elif language == "python":
            if re.fullmatch(r"# \w+\.py", first):
                (folder / first[2:]).write_text(block, encoding="utf-8")
            exec(compile(block, first, "exec"), names)
    assert not failures, "".join(failures)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [pytest.param(page, marks=[pytest.mark.nightly] if page in HEAVY else []) for page in PAGES]
)  # fmt: skip
def test_a_page_of_the_guide_runs_as_it_says(page, tmp_path, monkeypatch):
    if page in NEEDED:
        pytest.importorskip(NEEDED[page])
    run_page((GUIDE / page).read_text(encoding="utf-8"), tmp_path, monkeypatch)


@pytest.mark.slow
def test_the_readme_runs_as_it_says(tmp_path, monkeypatch):
    run_page(README.read_text(encoding="utf-8"), tmp_path, monkeypatch)


def test_the_front_of_the_guide_links_every_page_and_chapter():
    front = (GUIDE / "index.md").read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#]+\.md)\)", front)
    assert len(links) == len(set(links))
    assert set(links) | {"index.md"} == {str(path.relative_to(GUIDE)) for path in GUIDE.rglob("*.md")}


@pytest.mark.parametrize("page", [README, *sorted(GUIDE.rglob("*.md"))], ids=lambda page: page.stem)
def test_links_and_pictures_of_a_page_exist(page):
    links = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    assert not [link for link in links if not re.match("https?:", link) and not (page.parent / link).exists()]


def test_the_installed_guide_is_written_as_pages_whose_links_exist(tmp_path):
    front = write_guide(tmp_path)
    assert front == tmp_path / "index.html"
    for page in GUIDE.rglob("*.md"):
        written = tmp_path / page.relative_to(GUIDE).with_suffix(".html")
        text = written.read_text(encoding="utf-8")
        links = re.findall(r'(?:href|src)="([^"#:]+)"', text)
        assert not [link for link in links if not (written.parent / link).exists()], page.name
    assert "<code>t / \\sigma</code>" in (tmp_path / "theory" / "tolerances.html").read_text(encoding="utf-8")


def test_every_picture_of_the_guide_is_shown():
    text = "".join(path.read_text(encoding="utf-8") for path in GUIDE.rglob("*.md"))
    assert not [path.name for path in (GUIDE / "pictures").iterdir() if f"pictures/{path.name}" not in text]


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


def test_the_readme_is_a_front():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 180
