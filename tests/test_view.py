"""The view of a model before any run: what it shows, and how faces are picked in a browser."""

import re

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tests.helpers import call, compiled
from tests.shapes import patch, shape, triangles_of
from tests.test_report import data_of, picture
from tolcontact.discretization import discretize
from tolcontact.geometry import preview
from tolcontact.report import write_view


def chosen(part, words):
    """The triangles that the words of a face choose."""
    face = eval(f"part.{words}", {"part": part, "tc": tc})
    return triangles_of(face)


GEOMETRIES = {
    "STEP": lambda: tc.Mesh(cases.MODELS / "cover.step"),
    "box": lambda: tc.Box(10, 20, 30),
    "ring": lambda: tc.Mesh(trimesh.creation.annulus(5, 20, 30, sections=48)),
    "wedge": lambda: tc.Mesh(trimesh.Trimesh(*_wedge())),
}


def _wedge():
    corners = [(x, y, z) for x in (0, 10) for y, z in ((0, 0), (20, 0), (0, 7))]
    hull = trimesh.convex.convex_hull(np.array(corners, dtype=float))
    return hull.vertices, hull.faces


@pytest.mark.slow
@pytest.mark.parametrize("name", GEOMETRIES)
def test_words_choose_the_face_that_they_are_of(name):
    part = tc.Assembly("a").part("part", GEOMETRIES[name](), at=(3, -4, 5), rotation=(0.1, 0.2, -0.3))
    found = preview(part)
    assert len(found.snippets) == len(found.descriptions) >= 4
    for face, words in zip(found.descriptions, found.snippets, strict=True):
        own = np.flatnonzero(found.face_of == face.number - 1)
        if "tc.select.Inside" in words:  # boxes cut: what they leave has the same area
            mesh = shape(part.geometry)
            area = patch(eval(f"part.{words}", {"part": part, "tc": tc}), {part: mesh}).mesh.area
            assert area == pytest.approx(mesh.area_faces[own].sum(), rel=1e-4)
        else:
            assert set(own) <= set(chosen(part, words).tolist())


def test_words_of_step_files_and_boxes_choose_nothing_else():
    for geometry in (GEOMETRIES["STEP"](), tc.Box(10, 20, 30)):
        part = tc.Assembly("a").part("part", geometry)
        found = preview(part)
        for face, words in zip(found.descriptions, found.snippets, strict=True):
            assert chosen(part, words).tolist() == np.flatnonzero(found.face_of == face.number - 1).tolist()


@pytest.mark.slow
def test_the_command_shows_models_step_files_and_archives(tmp_path):
    for what in (cases.MODELS / "ra1.py", cases.MODELS / "cover.step"):
        done = call(tmp_path, "view", what, "--out", tmp_path / "page.html")
        assert (done.returncode, done.stdout) == (0, f"page: {tmp_path / 'page.html'}\n"), done.stderr
        parts = data_of((tmp_path / "page.html").read_text())["scene"]["parts"]
        assert (
            all(face["snippet"].startswith("face(tc.select.Brep((") for face in parts[-1]["described"]) or what.suffix == ".py"
        )
    tc.run(compiled(cases.stack(), solver="daqp"), samples=10, out=tmp_path / "stack.nc").close()
    done = call(tmp_path, "view", tmp_path / "stack.nc", "--out", tmp_path / "run.html")
    assert done.returncode == 0 and "Contact and certificates" in (tmp_path / "run.html").read_text()
    done = call(tmp_path, "view", tmp_path / "nothing.step", "--out", tmp_path / "no.html")
    assert (done.returncode, done.stdout) == (2, "") and not (tmp_path / "no.html").exists()


@pytest.mark.slow
def test_gaps_of_the_nominal_assembly_are_those_of_the_drawing(tmp_path):
    a = cases.model("cover")
    write_view(a, discretize(a), [], tmp_path / "cover.html")
    page = (tmp_path / "cover.html").read_text()
    rows = dict(re.findall(r'<th scope="row">([^<]*)</th><td class="figure">\d+</td><td class="figure">([^<]*)</td>', page))
    assert float(rows["seat"]) == pytest.approx(0, abs=1e-9)
    assert float(rows["round hole"]) == pytest.approx(0.05, abs=1e-6)  # 8.1 around 8


def test_faults_are_listed_and_sound_parts_shown(tmp_path):
    a = cases.stack()
    a.part("broken", tc.Mesh("nowhere.stl"))
    faults = tc.check(a)
    write_view(a, None, faults, tmp_path / "stack.html")
    page = (tmp_path / "stack.html").read_text()
    assert "nowhere.stl" in page and [part["name"] for part in data_of(page)["scene"]["parts"]] == ["bottom", "middle", "upper"]


@pytest.mark.slow
def test_faces_are_picked(tmp_path, open_page):
    a = tc.Assembly("box")
    a.part("box", tc.Box(100, 50, 20))
    write_view(a, None, [], tmp_path / "box.html")
    opened = open_page(tmp_path / "box.html")
    box = opened.locator("#scene").bounding_box()
    opened.mouse.click(box["x"] + 5, box["y"] + 5)
    assert "Click on a face" in opened.locator("#message").inner_text()
    place = opened.evaluate("new THREE.Vector3(50, 25, 20).project(viewer.camera).toArray()")
    opened.mouse.click(box["x"] + (1 + place[0]) / 2 * box["width"], box["y"] + (1 - place[1]) / 2 * box["height"])
    said = opened.locator("#message").inner_text()
    assert said.startswith("part box\n") and 'face("+z")\npoint(' in said and said.endswith("on it")


@pytest.mark.slow
def test_points_are_picked_in_the_parts_own_frame(tmp_path, open_page):
    a = tc.Assembly("box")
    a.part("box", tc.Box(100, 50, 20), at=(30, -20, 5), rotation=(0, 0, np.pi / 2))
    write_view(a, None, [], tmp_path / "box.html")
    opened = open_page(tmp_path / "box.html")
    box = opened.locator("#scene").bounding_box()
    for own in ((99.5, 0.5, 20), (50, 25, 20)):
        at = [30 - own[1], -20 + own[0], 5 + own[2]]  # turned to the left
        place = opened.evaluate(f"new THREE.Vector3(...{at}).project(viewer.camera).toArray()")
        opened.mouse.click(box["x"] + (1 + place[0]) / 2 * box["width"], box["y"] + (1 - place[1]) / 2 * box["height"])
        words = opened.locator("#message").inner_text().splitlines()[-1]
        found = [float(x) for x in re.search(r"point\((.*)\)", words)[1].split(", ")]
        assert found == pytest.approx([100, 0, 20] if own[1] < 1 else own, abs=0.3) and ("on it" in words) == (own[1] > 1)


@pytest.mark.slow
def test_features_are_named_where_they_are(tmp_path, open_page):
    a = cases.model("lid")
    nominal = discretize(a)
    write_view(a, nominal, [], tmp_path / "lid.html")
    named = {each["name"]: each["at"] for each in data_of((tmp_path / "lid.html").read_text())["scene"]["features"]}
    assert named == {face.name: face.centre.tolist() for face in nominal.faces} and len(named) == 8
    opened = open_page(tmp_path / "lid.html")
    before = picture(opened)
    opened.check("#features")
    assert picture(opened) != before and opened.evaluate("viewer.marks.features.children.length") == 8
