"""The guide: its examples run, and the reference is built from docstrings, with every public name and every chapter."""

import doctest
import importlib
import re

import pdoc
import pytest

import tolcontact as tc

CHAPTERS = (
    "declaration", "discretization", "variation", "mechanics", "compilation", "contact", "simulation", "statistics", "archive",
    "report", "workflow", "cli",
)  # fmt: skip
PACKAGES = ("tolcontact", *(f"tolcontact.{chapter}" for chapter in CHAPTERS))


@pytest.mark.parametrize("package", PACKAGES)
def test_examples_of_the_guide_run(package):
    text = importlib.import_module(package).__doc__
    test = doctest.DocTestParser().get_doctest(text, {}, package, None, 0)
    assert test.examples
    failures = []
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE).run(test, out=failures.append)
    assert not failures, "".join(failures)


def test_front_names_every_chapter_in_order():
    named = re.findall(r"^\| .* \| `tolcontact\.(\w+)` \|", tc.__doc__, re.MULTILINE)
    assert tuple(named) == CHAPTERS


def test_front_names_every_public_name():
    table = tc.__doc__.partition("## Names")[2]
    assert set(re.findall(r"`(\w+)`", table)) == set(tc.__all__) - {"__version__"}


@pytest.mark.filterwarnings("error")
def test_reference_is_built_from_docstrings(tmp_path):
    pdoc.render.configure(show_source=False)
    pdoc.pdoc(*PACKAGES, output_directory=tmp_path)
    front = (tmp_path / "tolcontact.html").read_text()
    assert all(f'id="{name}"' in front for name in tc.__all__ if name != "__version__")
    for chapter in CHAPTERS:
        page = (tmp_path / "tolcontact" / f"{chapter}.html").read_text()
        assert "A chapter of the guide." in page
