"""Problems with known answers, and the site that shows them."""

import re

import pytest

import tolcontact as tc
from studies.site.build import build, models
from studies.verification.problems import PROBLEMS
from tests.test_guide import CHAPTERS


@pytest.mark.slow
@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.number)
def test_known_answers_are_computed(problem):
    figures = [*problem.figures()]
    assert figures and not [figure for figure in figures if not figure.agrees]
    assert any(figure.verdict == "agrees" for figure in figures)


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.filterwarnings("error::UserWarning:pdoc")
def test_the_site_is_built(tmp_path, drawing):
    some = [path for path in models() if path.stem in ("ra1", "clutch")]
    build(tmp_path, 50, some, [PROBLEMS[1]])
    assert len(models()) == 11
    front = (tmp_path / "reference" / "tolcontact.html").read_text()
    assert all(f'id="{name}"' in front for name in tc.__all__ if name not in ("__version__", "plot"))
    for chapter in CHAPTERS:
        assert "A chapter of the guide." in (tmp_path / "reference" / "tolcontact" / f"{chapter}.html").read_text()
    gallery = (tmp_path / "gallery.html").read_text()
    assert "What does contact do to its corner height?" in gallery and "<td>corrected</td>" in gallery
    assert {"ra1.png", "clutch.png"} == {path.name for path in tmp_path.glob("*.png")}
    verification = (tmp_path / "verification.html").read_text()
    assert "1 figures of 1 problems" in verification and verification.count("agrees</td>") == 1
    for page in tmp_path.glob("*.html"):
        for link in re.findall(r'(?:href|src)="([^"#]+)"', page.read_text()):
            assert (tmp_path / link).exists(), f"{page.name}: {link}"
