"""Features in the view of a model: each is listed with its tolerances and found on its faces, and a face names its features."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tests.helpers import call
from tests.test_report import ODD, data_of
from tolcontact.discretization import discretize
from tolcontact.errors import ModelError
from tolcontact.report import nominal_and_faults, write_view

TURN = (0.3, -0.2, 0.5)
SCRIPT = """
import tolcontact as tc


def assembly():
    model = tc.Assembly("block")
    block = model.part("block", tc.Box(10, 20, 30))
    block.feature("top", block.face("+z"), tc.Flatness(0.1), {tolerance})
    return model
"""


def view(model, path):
    """The data of the scene in the view of a model, complete or not."""
    write_view(model, *nominal_and_faults(model), path)
    return data_of(path.read_text(encoding="utf-8"))["scene"]


def faces_of(feature):
    """The triangles of each face of each member."""
    pairs = [np.reshape(face["runs"], (-1, 2)) for member in feature["members"] for face in member["faces"]]
    return [[triangle for start, stop in runs for triangle in range(start, stop)] for runs in pairs]


def block():
    """A turned box: a datum of two faces, a face of one half, and one that lies behind."""
    a = tc.Assembly("block")
    part = a.part("block", tc.Box(40, 30, 20), at=(5, -3, 2), rotation=TURN, fixed=True)
    part.pattern("A", part.face("+z"), part.face("+x"), datum="A")
    part.feature("half", part.face("-y", tc.select.Inside((0, -1, 0), (20, 1, 20))), tc.Flatness(0.1))
    part.feature("bottom", part.face("-z"), tc.Parallelism(0.2, "A"))
    return a


def test_features_of_boxes_and_meshes_have_their_triangles(tmp_path):
    a = tc.Assembly("plate and box")
    plate = a.part("plate", tc.Mesh(trimesh.creation.annulus(5, 20, 30, sections=48)), at=(300, 0, 0), fixed=True)
    plate.feature("bore", plate.face(tc.select.Cylinder(inner=True)), tc.Size(10, 0.1), datum="B")
    box = a.part("box", tc.Box(10, 20, 30), at=(0, 300, 0), fixed=True)
    box.pattern("sides", box.face("+x"), box.face("+y"), datum="A")
    nominal = discretize(a, incomplete=True)
    lists = {entry["part"]: entry["features"] for entry in view(a, tmp_path / "page.html")["toleranced"]}
    assert list(lists) == ["plate", "box"]
    meshes = {part.name: part.mesh for part in nominal.parts}
    (bore,) = lists["plate"]
    radii = np.linalg.norm(meshes["plate"].triangles_center[:, :2], axis=1)
    assert faces_of(bore) == [np.flatnonzero((radii < 5.01) & (np.abs(meshes["plate"].face_normals[:, 2]) < 0.5)).tolist()]
    assert (bore["name"], bore["datum"], bore["tolerances"]) == ("bore", "B", ["size 10 +0.1 -0.1 mm"])
    normals = meshes["box"].face_normals
    assert faces_of(lists["box"][0]) == [np.flatnonzero(normals[:, k] > 0.9).tolist() for k in (0, 1)]


@pytest.mark.slow
def test_features_of_step_files_have_their_triangles(tmp_path):
    a = cases.model("cover")
    lists = {entry["part"]: entry["features"] for entry in view(a, tmp_path / "page.html")["toleranced"]}
    assert list(lists) == ["cover", "round pin", "slotted pin"]
    mesh = next(part.mesh for part in discretize(a).parts if part.name == "cover")
    (hole,) = faces_of(lists["cover"][0])
    corners = mesh.triangles[hole].reshape(-1, 3)[:, :2]
    assert np.linalg.norm(corners - (15, 15), axis=1) == pytest.approx(4.05, abs=1e-3)
    assert mesh.area_faces[hole].sum() == pytest.approx(np.pi * 8.1 * 8, rel=1e-3)


def test_models_without_features_have_no_list(tmp_path):
    a = tc.Assembly("box")
    a.part("box", tc.Box(10, 20, 30))
    assert view(a, tmp_path / "box.html")["toleranced"] == []
    page = (tmp_path / "box.html").read_text()
    assert 'id="toleranced"' not in page and "Face under the mouse" in page


def test_a_model_may_lack_measures_and_locations(tmp_path):
    a = cases.stack()
    complete = view(a, tmp_path / "complete.html")
    incomplete = a.replaced(measures=[], locations=[location for location in a.locations if location.part.name == "middle"])
    scene = view(incomplete, tmp_path / "incomplete.html")
    page = (tmp_path / "incomplete.html").read_text()
    assert "it measures nothing" in page and page.count("it is not located") == 1  # the bottom is fixed
    assert not any(part["faulty"] for part in scene["parts"]) and " fault" not in page.split("</header>")[0]
    assert len(scene["locators"]) == 6 and [pair["name"] for pair in scene["contacts"]] == [
        pair["name"] for pair in complete["contacts"]
    ]
    with pytest.raises(ModelError, match="measures nothing"):
        discretize(incomplete)


def test_a_fault_of_a_feature_is_listed_in_a_model_that_lacks_measures(tmp_path):
    a = block().replaced(measures=[])
    a.parts[0].feature("bottom again", a.parts[0].face("-z"), tc.Flatness(0.1))
    a.parts[0].feature("wrong", a.parts[0].face(tc.select.Brep(7)), tc.Flatness("thin"))
    (entry,) = view(a, tmp_path / "first.html")["toleranced"]
    assert entry["features"][-1]["tolerances"] == ["flatness"] and not faces_of(entry["features"][-1])
    assert "expected the full width" in (tmp_path / "first.html").read_text()
    b = block()
    b.parts[0].feature("bottom again", b.parts[0].face("-z"), tc.Flatness(0.1))
    scene = view(b, tmp_path / "second.html")
    assert "it shares a face with feature" in (tmp_path / "second.html").read_text() and scene["parts"][0]["faulty"]


@pytest.mark.slow
def test_the_command_shows_an_incomplete_script(tmp_path):
    (tmp_path / "block.py").write_text(SCRIPT.format(tolerance="tc.Profile(0.2)"))
    done = call(tmp_path, "view", "block.py", "--out", tmp_path / "page.html")
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "page.html").read_text()
    (entry,) = data_of(page)["scene"]["toleranced"]
    assert entry["features"][0]["tolerances"] == ["flatness 0.1", "profile 0.2"]
    assert "it is not located" in page and "faulty parts" not in page


COLOURS = """(places) => {
  const scene = document.getElementById("scene"), canvas = document.createElement("canvas");
  Object.assign(canvas, { width: scene.width, height: scene.height });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(scene, 0, 0);
  return places.map(([x, y]) => Array.from(context.getImageData(x * canvas.width, y * canvas.height, 1, 1).data));
}"""


class Scene:
    """A page in a browser, with points of a part in the part's own frame."""

    def __init__(self, page, part):
        self.page, self.part = page, part
        self.box = page.locator("#scene").bounding_box()

    def place(self, *point):
        """Where a point of the part is drawn: shares of the width and the height of the scene."""
        R = trimesh.transformations.rotation_matrix(np.linalg.norm(self.part.rotation), self.part.rotation)[:3, :3]
        x, y, _ = self.page.evaluate(
            f"new THREE.Vector3(...{(R @ point + self.part.at).tolist()}).project(viewer.camera).toArray()"
        )
        return (1 + x) / 2, (1 - y) / 2

    def click(self, *point):
        x, y = self.place(*point)
        self.page.mouse.click(self.box["x"] + x * self.box["width"], self.box["y"] + y * self.box["height"])
        return self.page.locator("#message").inner_text()

    def colours(self, *points):
        """Red, green, blue and opacity where points of the part are drawn."""
        return np.array(self.page.evaluate(COLOURS, [self.place(*point) for point in points]), dtype=float)

    def blueness(self, *points):
        colours = self.colours(*points)
        return colours[:, 2] / colours[:, :2].mean(axis=1)

    def pressed(self):
        return [button.inner_text().splitlines()[0] for button in self.page.locator("#toleranced [aria-pressed=true]").all()]


TOP, END, NEAR_HALF, FAR_HALF, BOTTOM = (8, 5, 20), (40, 8, 3), (3, 0, 3), (35, 0, 3), (15, 5, 0)
# Whether the faces of each feature are seen at these points; the bottom is behind the side, with the half in front of it.
SEEN = {"pattern A": [1, 1, 0, 0], "feature half": [0, 0, 1, 0]}


@pytest.mark.slow
@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_a_feature_is_found_on_its_faces(width, scheme, tmp_path, open_page):
    a = block()
    view(a, tmp_path / "block.html")
    page = open_page(tmp_path / "block.html", width)
    page.emulate_media(color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    scene = Scene(page, a.parts[0])
    points = (TOP, END, NEAR_HALF, FAR_HALF)
    before = scene.blueness(*points)
    for name, seen in SEEN.items():
        page.locator("#toleranced button", has_text=name).click()
        assert (scene.blueness(*points) > 1.4 * before).tolist() == [bool(mark) for mark in seen], name
        assert len(scene.pressed()) == 1 and scene.pressed()[0].startswith(name)
    page.locator("#toleranced button", has_text="feature half").click()
    assert scene.blueness(*points) == pytest.approx(before) and not scene.pressed()
    page.locator("#toleranced button", has_text="feature bottom").click()
    assert page.locator("#message").inner_text() == "part block\nfeature bottom\nparallelism 0.2 A"
    assert (scene.blueness(BOTTOM) > 1.1 * before[2:].max()).all()  # through what is before it
    page.locator("#toleranced button", has_text="pattern A").click()
    page.select_option("#across", "z")
    page.locator("#cut").fill("0")
    assert scene.colours(TOP)[0, 3] == 0  # cut away with its face


@pytest.mark.slow
def test_a_face_names_its_features(tmp_path, open_page):
    a = block()
    view(a, tmp_path / "block.html")
    scene = Scene(open_page(tmp_path / "block.html"), a.parts[0])
    before = scene.blueness(TOP)
    said = scene.click(*END)
    assert 'face("+x")' in said and said.endswith("\n\npattern A (datum A), member A 2")
    assert scene.pressed() == ["pattern A (datum A), 2 members"] and (scene.blueness(TOP) > 1.4 * before).all()
    assert (scene.blueness(END) < 0.5).all()  # the face that was clicked on has a colour of its own
    assert scene.click(*NEAR_HALF).endswith("\n\nfeature half\nflatness 0.1")
    assert "feature" not in scene.click(*FAR_HALF) and not scene.pressed()
    scene.click(*END)
    scene.page.mouse.click(scene.box["x"] + 5, scene.box["y"] + 5)
    assert not scene.pressed() and scene.blueness(TOP) == pytest.approx(before)


@pytest.mark.slow
def test_odd_names_of_features_are_texts(tmp_path, open_page):
    names = [ODD, "quotes \" ' \\ & é 点", "Größe </script> & <b>", "`${alert(1)}`"]
    a = tc.Assembly("odd")
    for k, name in enumerate(names):
        part = a.part(name, tc.Box(10, 10, 10), at=(20 * k, 0, 0), fixed=True)
        part.feature(name, part.face("+z"), tc.Flatness(0.1))
    view(a, tmp_path / "odd.html")
    page = open_page(tmp_path / "odd.html")
    buttons, headings = page.locator("#toleranced button"), page.locator("#toleranced h3")
    for k, name in enumerate(names):
        assert buttons.nth(k).inner_text() == f"feature {name}\nflatness 0.1" and headings.nth(k).inner_text() == f"part {name}"
        buttons.nth(k).click()
        assert page.locator("#message").inner_text() == f"part {name}\nfeature {name}\nflatness 0.1"
