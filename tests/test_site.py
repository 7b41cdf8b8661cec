"""The site: guide, reference of public names, gallery, and the problems of the benchmarks with their answers."""

import re
import types

import pytest

import tolcontact as tc
from studies.benchmarks.problem import problems
from tests.test_guide import GUIDE

pytest.importorskip("sphinx", reason="the extra docs is not installed")
pytest.importorskip("furo", reason="the extra docs is not installed")


@pytest.mark.nightly
@pytest.mark.slow
def test_the_site_is_built_without_a_warning_a_broken_link_or_anything_fetched(tmp_path, drawing):
    from studies.site.build import build, models  # noqa: PLC0415  (needs Sphinx)

    some = [path for path in models() if path.stem in ("ra1", "clutch")]
    build(tmp_path, 50, some, problems(["worst_clutch", "lobed_shaft_in_a_bore"]))
    assert len(models()) == 14
    names = (tmp_path / "names.html").read_text(encoding="utf-8")
    assert all(
        f'id="tolcontact.{name}"' in names
        for name in tc.__all__
        if name != "__version__" and not isinstance(getattr(tc, name), types.ModuleType)
    )
    for page in GUIDE.rglob("*.md"):
        assert (tmp_path / page.relative_to(GUIDE).with_suffix(".html")).exists()
    assert "<math" in (tmp_path / "theory" / "tolerances.html").read_text(encoding="utf-8")
    gallery = (tmp_path / "gallery.html").read_text(encoding="utf-8")
    assert "What does contact do to its corner height?" in gallery and '<table class="results">' in gallery
    verification = (tmp_path / "verification.html").read_text(encoding="utf-8")
    assert "4 figures of 2 problems" in verification and verification.count("agrees") == 2
    for page in tmp_path.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(?:https?:)?//', text), page.name
        for link in re.findall(r'<(?:a|img)[^>]*(?:href|src)="([^"#?:]+)"', text):
            assert (page.parent / link).exists(), f"{page.name}: {link}"
