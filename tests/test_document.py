"""The report as a document: its words, pictures of measurements, contributors, folds, and how it prints."""

import re

import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import compiled, nightly
from tolcontact.report import write_page


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("document") / "ra1.nc"
    tc.run(compiled(cases.ra1(), solver="daqp"), samples=1000, seed=1, out=path, surfaces=8).close()
    return path


@pytest.fixture(scope="module")
def page(archive):
    path = archive.with_suffix(".html")
    with tc.open_archive(archive) as results:
        write_page(results, tc.summarize(results), path)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, *nightly(1280)])
def test_nothing_is_cut_off_and_words_are_those_of_designers(page, width, open_page):
    opened = open_page(page, width)
    assert opened.evaluate("document.documentElement.scrollWidth") <= width
    beyond = """[...document.querySelectorAll("main *")].filter((e) => !e.closest(".wide, svg, details:not([open]), [hidden]")
        && e.getBoundingClientRect().right > innerWidth + 1).map((e) => e.outerHTML.slice(0, 80))"""
    assert opened.evaluate(beyond) == []
    text = opened.locator("body").inner_text()
    assert not re.findall(r"\b(raw|corrected|carries|measures?)\b", text)
    for words in ("with contact", "out of specification", "does not meet", "tolerance (full width of the zone), mm"):
        assert words in text, words


@pytest.mark.slow
def test_a_measurement_has_a_picture_limits_and_contributors(page, open_page):
    opened = open_page(page)
    assert opened.evaluate("document.querySelector('.portrait img').naturalWidth") == 480
    notes = opened.evaluate("document.querySelector('.histogram .chart').layout.annotations.map((note) => [note.x, note.text])")
    assert notes == [[-0.5, "lower limit -0.5"], [0.5, "upper limit 0.5"]]
    names, shares = opened.evaluate(
        "(() => { const t = document.querySelector('.contributors .chart').data[0]; return [t.y, t.x]; })()"
    )
    assert len(names) == 10 and shares == sorted(shares) and shares[-1] > 20  # the largest is drawn last, above
    assert opened.locator(".convergence .chart").count() == 0
    opened.locator(".convergence summary").click()
    opened.wait_for_selector(".convergence .main-svg")
    assert not opened.locator("#run ~ details dl").is_visible()


@pytest.mark.slow
def test_on_paper_charts_are_as_wide_as_the_page_and_settings_unfolded(page, tmp_path, open_page):
    opened = open_page(page)
    widths = "[...document.querySelectorAll('.pictures .js-plotly-plot')].map((box) => box.layout.width ?? null)"
    opened.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert opened.evaluate(widths) == [520, 520] and opened.locator("#run ~ details dl").is_visible()
    opened.evaluate("window.dispatchEvent(new Event('afterprint'))")
    assert opened.evaluate(widths) == [None, None] and not opened.locator("#run ~ details dl").is_visible()
    assert opened.pdf(path=tmp_path / "page.pdf", prefer_css_page_size=True).startswith(b"%PDF")


@pytest.mark.slow
def test_long_tables_of_analyses_are_folded_after_fifteen_rows(tmp_path):
    a = tc.Assembly("many")
    block = a.part("block", tc.Box(60, 40, 10))
    a.locate(block, cases.translating(0.1))
    for number in range(20):
        part = a.part(f"p{number}", tc.Box(5, 5, 5), at=(10 * number, 50, 0))
        a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x")), tolerance=0.1, on=block)
    a.measure("sum", lambda poses: sum(poses.translation(part)[2] for part in a.parts[1:]), tolerance=3)
    path = tmp_path / "many.nc"
    tc.run(compiled(a), samples=50, out=path).close()
    tc.analyses.sensitivities(a, samples=10, into=path)
    with tc.open_archive(path) as results:
        write_page(results, tc.summarize(results), tmp_path / "many.html")
    page = (tmp_path / "many.html").read_text(encoding="utf-8")
    section = page[page.index('id="answers"') : page.index('id="assembly"')]
    assert re.search(r"<details><summary>\d+ more</summary>", section)
    assert section[: section.index("<details>")].count('<tr><th scope="row">') == 15
