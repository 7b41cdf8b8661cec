"""The report as a document: its words, pictures of measurements, contributors, folds, and how it prints."""

import re
from io import StringIO

import pytest
from rich.console import Console

import tolcontact as tc
from tests import cases
from tests.helpers import nightly
from tolcontact.report import summary_text, write_page
from tolcontact.report.table import Table


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("document") / "ra1.nc"
    tc.run(cases.ra1(), samples=1000, seed=1, solver="daqp", out=path, surfaces=8).close()
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
    tc.run(a, samples=50, out=path).close()
    tc.analyses.sensitivities(a, samples=10, into=path)
    with tc.open_archive(path) as results:
        write_page(results, tc.summarize(results), tmp_path / "many.html")
    page = (tmp_path / "many.html").read_text(encoding="utf-8")
    section = page[page.index('id="answers"') : page.index('id="assembly"')]
    assert re.search(r"<details><summary>\d+ more</summary>", section)
    assert section[: section.index("<details>")].count('<tr><th scope="row">') == 15


def test_headings_of_several_lines_stand_at_the_bottom(archive):
    with tc.open_archive(archive) as results:
        summary = tc.summarize(results)
    console = Console(width=80, file=StringIO(), highlight=False)
    console.print(summary_text(summary))
    lines = console.file.getvalue().splitlines()
    place = next(k for k, line in enumerate(lines) if line.endswith("specification"))
    assert lines[place - 1].strip() == "out of" and "mean" in lines[place] and max(map(len, lines)) <= 80
    console.print(Table("", ["a", "two\nlines"], [["x", "1"]]))
    assert [line.rstrip() for line in console.file.getvalue().splitlines()[-4:]] == [
        "     two",
        "a  lines",
        "────────",
        "x      1",
    ]


def test_a_label_stands_beside_the_first_line_of_its_figures_in_tables_that_are_too_wide():
    console = Console(width=80, file=StringIO(), highlight=False)
    label = "a label of many words that is wrapped since the table is too wide"
    console.print(Table("", ["", "mean", "two\nlines"], [[label, "1 [0, 2]", "3 [2, 4]"], ["b", f"{'9' * 40} [0, 2]", ""]]))
    lines = [line.rstrip() for line in console.file.getvalue().splitlines()]
    assert lines[0].endswith("two") and lines[1].split() == ["mean", "lines"]
    first = next(line for line in lines if line.startswith("a label"))
    assert first.split()[-2:] == ["1", "3"] and lines[lines.index(first) + 1].endswith("[0, 2]   [2, 4]")
