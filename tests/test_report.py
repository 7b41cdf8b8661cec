"""The report: what its page says, what it leaves out, and how it is used in a browser."""

import base64
import gzip
import json
import re

import numpy as np
import pytest
import trimesh
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.helpers import call, compiled, nightly
from tests.test_formats import STORED
from tolcontact.report import write_page

ODD = "0<img src=x onerror=alert(1)> <script>alert(2)"


def page_of(archive, path):
    with tc.open_archive(archive) as results:
        write_page(results, tc.summarize(results), path)
    return path.read_text(encoding="utf-8")


def data_of(page):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])


def unpacked(of):
    """An array that a page holds."""
    return np.frombuffer(base64.b64decode(of["data"]), f"<{of['kind']}").reshape(of["shape"])


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "ra1.nc"
    tc.run(compiled(cases.ra1(), solver="daqp"), samples=500, seed=1, out=path, surfaces=8).close()
    return path


@pytest.fixture(scope="module")
def page(archive):
    path = archive.with_suffix(".html")
    page_of(archive, path)
    return path


@pytest.mark.slow
def test_the_command_writes_a_page_that_says_what_the_summary_says(archive, tmp_path):
    done = call(tmp_path, "report", archive, "--out", tmp_path / "page.html")
    assert (done.returncode, done.stdout) == (0, f"report: {tmp_path / 'page.html'}\n"), done.stderr
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    printed = call(tmp_path, "summary", archive).stdout
    for figures in re.findall(r"\[[-\d., inf]+\]", printed)[:40]:
        assert figures in page
    assert 1_800_000 < len(page) < 8_000_000
    assert [*tmp_path.iterdir()] == [tmp_path / "page.html"]


def test_counts_of_a_histogram_are_all_realizations(archive, page):
    (chart,) = data_of(page.read_text())["charts"]
    measured = tc.open_archive(archive)["measured"].values
    for state in (0, 1):
        counts, _ = np.histogram(measured[:, state, 0], chart["edges"])
        assert counts.tolist() == chart["states"][state]["counts"] and counts.sum() == 500
    assert chart["limits"] == [-0.5, 0.5]


def test_extreme_realizations_are_shown_first(archive, page):
    shown = data_of(page.read_text())["scene"]["realizations"]
    order = np.argsort(tc.open_archive(archive)["measured"].values[:, 1, 0])
    said = {"smallest": order[:5], "largest": order[::-1][:5]}
    assert shown["names"][:10] == [f"realization {row} ({word} corner height)" for word, rows in said.items() for row in rows]
    assert len(shown["names"]) == 300


@pytest.mark.slow
@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"fields": "none", "keep": "poses"}, None),
        ({"keep": "measures", "fields": "none"}, "has no poses"),
        *nightly(({"keep": "measures"}, "has no poses")),
    ],
)
def test_what_an_archive_does_not_have_is_said(settings, said, tmp_path):
    tc.run(compiled(cases.stack(), solver="daqp"), samples=20, out=tmp_path / "little.nc", **settings).close()
    page = page_of(tmp_path / "little.nc", tmp_path / "little.html")
    found = data_of(page)
    assert ("motions" in found["scene"]["realizations"]) == (settings.get("keep") != "measures")
    assert said is None or said in page


def test_one_part_without_contact_is_a_page_too(tmp_path):
    a = tc.Assembly("alone")
    block = a.part("block", tc.Box(10, 20, 10))
    a.locate(block, cases.translating(0.1))
    a.measure("height", block.point(5, 5, 10), along="z", limits=(None, 0.2))
    tc.run(compiled(a), samples=10, out=tmp_path / "alone.nc").close()
    found = data_of(page_of(tmp_path / "alone.nc", tmp_path / "alone.html"))
    assert found["scene"]["contacts"] == [] and found["charts"][0]["limits"] == [None, 0.2]


@pytest.mark.slow
def test_a_measure_that_is_no_number_leaves_its_chart_out(tmp_path):
    a = cases.ra1()
    a.measure("nothing", lambda poses: 0 * poses.translation(a.parts[0])[0] / 0)
    tc.run(compiled(a, solver="daqp"), samples=10, out=tmp_path / "nan.nc").close()
    found = data_of(page_of(tmp_path / "nan.nc", tmp_path / "nan.html"))
    assert found["charts"][1]["edges"] == [] and found["charts"][0]["edges"]


@pytest.mark.parametrize(("name", "said"), [("page.nc", "not the name of a page"), ("nowhere/page.html", "no folder")])
def test_where_no_page_can_be_is_said_before_anything_is_done(name, said, archive, tmp_path):
    for command in (["report", archive, "--out", tmp_path / name], ["run", "x.py", "--report", tmp_path / name]):
        done = call(tmp_path, *command)
        assert (done.returncode, done.stdout) == (2, "") and said in done.stderr
    assert not [*tmp_path.iterdir()]


@pytest.mark.slow
def test_the_archive_that_is_kept_has_a_page(tmp_path):
    path = tmp_path / "bars.nc"
    path.write_bytes(gzip.decompress(STORED.read_bytes()))
    assert data_of(page_of(path, tmp_path / "bars.html"))["charts"][0]["edges"]


def picture(page):
    """The pixels of the scene."""
    return page.evaluate("document.getElementById('scene').toDataURL()")


@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, *nightly(390)])
def test_the_page_is_used(archive, page, width, open_page):
    opened = open_page(page, width)
    assert opened.evaluate("document.documentElement.scrollWidth") <= width
    first = picture(opened)
    box = opened.locator("#scene").bounding_box()
    opened.locator("#scene").scroll_into_view_if_needed()
    box = opened.locator("#scene").bounding_box()
    opened.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    opened.mouse.down()
    opened.mouse.move(box["x"] + box["width"] / 2 + 80, box["y"] + box["height"] / 2 + 20, steps=3)
    opened.mouse.up()
    turned = picture(opened)
    assert turned != first
    opened.select_option("#component", "2")
    along_z = picture(opened)
    assert along_z != turned and opened.locator("#bar").is_visible()
    with tc.open_archive(archive) as results:
        largest = float(max(results[f"field/{part}"].six_sigma.sel(component="z").max() for part in ("base", "top")))
        measured = results["measured"].values[:, :, 0]
    assert float(opened.locator("#high").inner_text()) == pytest.approx(largest, rel=1e-3)
    opened.select_option("#field", "")
    assert not opened.locator("#bar").is_visible()
    opened.locator("#which").fill("7")
    said = opened.locator("#message").inner_text()
    row = int(re.match(r"realization (\d+) ", said)[1])
    raw, corrected = re.search(r"without contact (\S+), with contact (\S+) mm", said).groups()
    assert [float(raw), float(corrected)] == pytest.approx(measured[row], rel=1e-3)
    moved = picture(opened)
    opened.locator("input[name=state][value='0']").check()
    assert picture(opened) != moved
    opened.select_option("#across", "x")
    assert opened.evaluate("viewer.parts[0].materials[0].clippingPlanes.length") == 1


@pytest.mark.slow
def test_a_histogram_is_read_in_the_page(archive, page, open_page):
    opened = open_page(page)
    x, y = opened.evaluate("(() => { const t = document.querySelector('.chart').data[1]; return [t.x, t.y]; })()")
    with tc.open_archive(archive) as results:
        expected = tc.summarize(results)["statistic_value"].isel(measure=0, state=1)
    mean = np.average(x, weights=y)
    assert sum(y) == 500 and mean == pytest.approx(float(expected.sel(statistic="mean", interval="estimate")), abs=x[1] - x[0])


@pytest.mark.slow
def test_measures_are_shown_against_contributors_and_each_other(archive, page, open_page):
    opened = open_page(page)
    with tc.open_archive(archive) as results:
        label = str(results["sample"].contributor.values[3])
        x, y = results["sample/deviation"].values[:, 3], results["measured"].values[:, 1, 0]
    opened.select_option("#abscissa", label=label)
    read = "(() => { const t = document.getElementById('points-chart').data[1]; return [t.x, t.y]; })()"
    assert np.abs(np.array(opened.evaluate(read)) - [x, y]).max() < 1e-5
    opened.select_option("#abscissa", label="corner height")
    same_x, same_y = opened.evaluate(read)
    assert same_x == same_y


@pytest.mark.slow
def test_odd_names_are_texts(tmp_path, open_page):
    a = tc.Assembly("odd &amp; <b>bold</b>")
    block = a.part(ODD, tc.Mesh(trimesh.creation.box((10, 20, 10))), at=(5, 10, 5))
    a.locate(block, cases.translating(0.1))
    a.measure("quotes \" ' \\ & é 点", block.point(0, 0, 5), along="z", tolerance=1)
    a.measure(ODD, block.point(0, 0, 5), along="z")
    tc.run(compiled(a), samples=10, out=tmp_path / "odd.nc").close()
    page_of(tmp_path / "odd.nc", tmp_path / "odd.html")
    opened = open_page(tmp_path / "odd.html")
    assert "odd &amp; <b>bold</b>" in opened.locator("h1").inner_text()
    assert ODD in opened.locator("#parts").inner_text()
    assert ODD in opened.locator("tbody").first.inner_text()
    assert "quotes \" ' \\ & é 点 (mm)" in opened.locator("tbody").first.inner_text()


@pytest.mark.slow
def test_an_unfinished_run_is_a_page_that_says_so(tmp_path):
    def stop(rows):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tc.run(compiled(cases.one_dimensional(6)), samples=60_000, out=tmp_path / "part.nc", progress=stop)
    page = page_of(tmp_path / "part.nc", tmp_path / "part.html")
    assert "of 60 000; the run is unfinished" in page and len(data_of(page)["scene"]["realizations"]["names"]) == 300


@pytest.mark.slow
def test_names_of_measurements_in_one_place_do_not_cover_each_other(tmp_path, open_page):
    a = tc.Assembly("alone")
    block = a.part("block", tc.Box(10, 20, 10))
    a.locate(block, cases.translating(0.1))
    for axis in "xyz":
        a.measure(f"place of the corner along {axis}", block.point(5, 5, 10), along=axis)
    tc.run(compiled(a), samples=10, out=tmp_path / "alone.nc").close()
    page_of(tmp_path / "alone.nc", tmp_path / "alone.html")
    opened = open_page(tmp_path / "alone.html", 390)
    boxes = np.array(
        opened.evaluate("""() => {
      const names = window.viewer.marks.points.children.filter((drawn) => drawn.isSprite);
      window.viewer.marks.points.visible = true;
      window.viewer.draw();
      return names.map((name) => boxOf(name, window.viewer.camera, -name.center.y - LIFT));
    }""")
    )
    assert len(boxes) == 3
    for k in range(3):
        for j in range(k):
            assert (boxes[k, :2] >= boxes[j, 2:] - 1e-6).any() or (boxes[j, :2] >= boxes[k, 2:] - 1e-6).any()
    hint = "getComputedStyle(document.querySelector('.wide'), '::before').content"
    assert "scrolls sideways" in opened.evaluate(hint)
    opened.set_viewport_size({"width": 1280, "height": 900})
    assert "scrolls sideways" not in opened.evaluate(hint)


def test_means_settle_within_students_interval(archive, page):
    (chart,) = data_of(page.read_text())["charts"]
    x = tc.open_archive(archive)["measured"].values[:, 1, 0]
    of = chart["states"][1]["settling"]
    found = unpacked(of)
    assert found[0, 0] == 2 and found[-1, 0] == 500
    for n, mean, half in found:
        some = x[: int(n)]
        expected = stats.t.ppf(0.975, n - 1) * some.std(ddof=1) / np.sqrt(n)
        assert [mean, half] == pytest.approx([some.mean(), expected], rel=1e-5, abs=1e-6)
