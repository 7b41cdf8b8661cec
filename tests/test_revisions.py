"""Two revisions of a model on one page: what changed in the model, in the result, and in the contributors; and its print."""

import shutil
import subprocess

import pytest

import tolcontact as tc
from tests.helpers import nightly
from tolcontact.report import write_comparison, write_page

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def revision(letter, width=0.3):
    block = tc.TitleBlock(revision=letter, author="A. Person", date="2026-11-29")
    stack = tc.Stack(f"stack {letter}", title_block=block)
    stack.link("left", 10, tc.Tolerance(width, "uniform"))
    stack.link("right", 5, 0.2, sensitivity=-1)
    stack.gap("gap", limits=(4.7, 5.3))
    return stack


@pytest.fixture(scope="module")
def runs():
    after = revision("B", 0.1)
    after.link("shim <1>", 0.1, 0.05)
    return {"before": tc.run(revision("A"), samples=1500), "after": tc.run(after, samples=1500)}


def test_two_revisions_are_on_one_page(runs, tmp_path):
    write_comparison(runs, tc.compare_runs(runs), tmp_path / "both.html")
    page = (tmp_path / "both.html").read_text(encoding="utf-8")
    for text in (
        "before: revision A, author A. Person, date 2026-11-29, seed 1",
        "<li>variables, left, tolerance, range: 0.3, now 0.1</li>",
        "<li>variables, shim &lt;1&gt;: added (shim &lt;1&gt;)</li>",
        "Contributors, share of the variance with contact",
    ):
        assert text in page
    left = next(line for line in page.splitlines() if '<th scope="row">left</th>' in line and "%" in line)
    before, after = (float(cell.split(" %")[0]) for cell in left.split('<td class="figure">')[1:3])
    variances = [0.3**2 / 12, 0.1**2 / 12]
    rest = (0.2 / 6) ** 2
    assert before == pytest.approx(100 * variances[0] / (variances[0] + rest), abs=2)
    assert after == pytest.approx(100 * variances[1] / (variances[1] + rest + (0.05 / 6) ** 2), abs=4)


def test_equal_models_have_no_changes(runs, tmp_path):
    twice = {"one": runs["before"], "other": runs["before"]}
    write_comparison(twice, tc.compare_runs(twice), tmp_path / "both.html")
    assert "other, compared with one: nothing" in (tmp_path / "both.html").read_text(encoding="utf-8")


@pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
@pytest.mark.parametrize("kind", ["report", *nightly("comparison")])
def test_a_page_prints_on_sheets_of_a4(runs, kind, tmp_path):
    path = tmp_path / "page.html"
    if kind == "report":
        write_page(runs["before"], tc.summarize(runs["before"]), path)
    else:
        write_comparison(runs, tc.compare_runs(runs), path)
    printing = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=8000", "--no-pdf-header-footer"]
    subprocess.run(
        [BROWSER, *printing, f"--print-to-pdf={tmp_path / 'page.pdf'}", path.as_uri()],
        check=True, capture_output=True, timeout=300,
    )  # fmt: skip
    content = (tmp_path / "page.pdf").read_bytes()
    boxes = {box.split(b"]")[0].strip(b" [") for box in content.split(b"/MediaBox")[1:]}
    assert len(boxes) == 1
    width, height = map(float, boxes.pop().split()[2:])
    assert (width, height) == (pytest.approx(595, abs=1), pytest.approx(842, abs=1))
    assert 1 <= content.count(b"/Type /Page\n") + content.count(b"/Type/Page\n") <= 4
