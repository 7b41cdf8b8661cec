"""The site: guide, gallery, and the problems of the benchmarks with their answers."""

import re
import types

import pytest

import tolcontact as tc
from studies.benchmarks.problem import problems
from studies.site.build import build, models
from tests.test_guide import CHAPTERS, GUIDE


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.filterwarnings("error::UserWarning:pdoc")
def test_the_site_is_built(tmp_path, drawing):
    some = [path for path in models() if path.stem in ("ra1", "clutch")]
    build(tmp_path, 50, some, problems(["worst_clutch", "lobed_shaft_in_a_bore"]))
    assert len(models()) == 14
    front = (tmp_path / "reference" / "tolcontact.html").read_text()
    assert all(
        f'id="{name}"' in front
        for name in tc.__all__
        if name != "__version__" and not isinstance(getattr(tc, name), types.ModuleType)
    )
    for chapter in CHAPTERS:
        title = (GUIDE / f"{chapter}.md").read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
        assert f">{title}" in (tmp_path / "reference" / "tolcontact" / f"{chapter}.html").read_text()
    gallery = (tmp_path / "gallery.html").read_text()
    assert "What does contact do to its corner height?" in gallery and '<table class="results">' in gallery
    assert {"ra1.webp", "clutch.webp"} == {path.name for path in tmp_path.glob("*.webp")}
    verification = (tmp_path / "verification.html").read_text()
    assert "4 figures of 2 problems" in verification and verification.count("agrees</td>") == 2
    assert verification.count("not supported</td>") == 2 and verification.count("<svg") == 2
    own = [tmp_path / f"{name}.html" for name in ("index", "gallery", "verification")]
    for page in [*own, *(tmp_path / "benchmarks").glob("*.html")]:
        for link in re.findall(r'(?:href|src)="([^"#]+)"', page.read_text()):
            assert (page.parent / link).exists(), f"{page.name}: {link}"
