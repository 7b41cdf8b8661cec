"""Several B-rep faces as one face: unions, and holes that a file splits into halves."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import tolcontact as tc
from tests.helpers import nightly
from tests.test_json_models import load_model, written
from tolcontact.discretization import discretize

AS1 = Path(__file__).resolve().parents[1] / "studies" / "cad" / "as1-oc-214.stp"
HALVES = [(6, 7), (8, 9), (10, 11), (12, 13), (14, 15), (16, 17)]  # of the plate's six holes


def plate_with(*selections, **toleranced):
    model = tc.Assembly("plate")
    plate = model.part("plate", tc.Mesh(AS1, body="plate_1"), fixed=True)
    plate.feature("top", plate.face(tc.Brep(1)), datum="A")
    feature = plate.feature("hole", plate.face(*selections), tc.Size(10, 0.1, -0.1), tc.Position(0.2, "A"))
    model.measure("corner", of=plate.point(0, 0, 0), along="z")
    return model, plate, feature


def chosen(selection):
    model, plate, _ = plate_with(tc.Brep(6, whole=True))
    return list(discretize(model).triangles(plate.face(selection)))


def test_a_union_has_the_triangles_of_all_its_faces():
    apart = [set(chosen(tc.Brep(number))) for number in (3, 7, 12)]
    assert set(chosen(tc.Brep(3, 7, 12))) == set.union(*apart) and sum(map(len, apart)) == len(set.union(*apart))
    assert (
        chosen(tc.Brep(3) | tc.Brep(7, 12)) == chosen(tc.Brep(12, 3, 7)) == chosen(tc.Brep(12, 7) | tc.Brep((180, 100, 13.33)))
    )
    with pytest.raises(TypeError, match="whole for both, or for none"):
        tc.Brep(3) | tc.Brep(6, whole=True)
    assert tc.Brep(np.int64(3), np.array([1.0, 2.0, 3.0])).which == (3, (1.0, 2.0, 3.0))
    assert "need numbers" in next(tc.Brep().faults())


def test_halves_of_a_hole_are_one_surface_by_each_of_their_numbers():
    faces = tc.faces_in(AS1, "plate_1")
    assert [face.whole for face in faces] == [(), (), (), (), (), *(pair for pair in HALVES for _ in pair), ()]
    assert "one surface with 7" in str(faces[5])
    for pair in HALVES:
        both = chosen(tc.Brep(*pair))
        point = faces[pair[0] - 1].point
        assert all(chosen(tc.Brep(which, whole=True)) == both for which in (*pair, point))
    assert chosen(tc.Brep(1, whole=True)) == chosen(tc.Brep(1))


def test_a_feature_on_half_a_hole_is_doubted_and_a_whole_one_has_its_axis():
    with pytest.warns(tc.FaceWarning, match=r'"hole".*1 of the 2 faces of one cylinder.*tc.Brep\(6, whole=True\)'):
        discretize(plate_with(tc.Brep(6))[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        whole = discretize(plate_with(tc.Brep(7, whole=True))[0])
        discretize(plate_with(tc.Brep(6, 7))[0])
        discretize(plate_with(tc.Brep(6), tc.Inside((0, 0, 2), (200, 200, 18)))[0])  # a part of the hole is what was asked for
    hole = next(nominal for nominal in whole.features if nominal.feature.name == "hole")
    assert np.allclose(hole.geometry.centre[:2], [47.5, 75 + 7.5 * 3**0.5], atol=1e-5)
    with pytest.raises(tc.ModelError, match="spans more than one surface"):
        discretize(plate_with(tc.Brep(6, 8, whole=True))[0])


def test_unions_and_whole_surfaces_come_with_json(tmp_path):
    model, _, _ = plate_with(tc.Brep(6, (47.46, 82.99, 6.667), whole=True))
    document = written(model, tmp_path / "first.json")
    again = load_model(tmp_path / "first.json")
    assert again.parts[0].features[1].faces[0].selections == (tc.Brep(6, (47.46, 82.99, 6.667), whole=True),)
    assert written(again, tmp_path / "second.json") == document
    text = (tmp_path / "first.json").read_text()
    for wrong in ('"all"', '"any ones"'):
        (tmp_path / "wrong.json").write_text(text.replace('"any"', wrong))
        with pytest.raises(tc.TolcontactError, match='faces under the key "any"'):
            load_model(tmp_path / "wrong.json")


def written_step(tmp_path, name):
    """A STEP file of a block, a shaft or a plate with round faces that are split into halves, made by the CAD kernel."""
    kernel = {
        module: pytest.importorskip(f"OCP.{module}")
        for module in ("gp", "BRepPrimAPI", "BRepAlgoAPI", "BRepBuilderAPI", "STEPControl", "ShapeUpgrade")
    }
    gp, primitives = kernel["gp"], kernel["BRepPrimAPI"]

    def box(lower, upper):
        return primitives.BRepPrimAPI_MakeBox(gp.gp_Pnt(*lower), gp.gp_Pnt(*upper)).Shape()

    def cylinder(at, along, radius, height):
        return primitives.BRepPrimAPI_MakeCylinder(gp.gp_Ax2(gp.gp_Pnt(*at), gp.gp_Dir(*along)), radius, height).Shape()

    def without(shape, *tools):
        for tool in tools:
            shape = kernel["BRepAlgoAPI"].BRepAlgoAPI_Cut(shape, tool).Shape()
        return shape

    hole = cylinder((0, 0, -1), (0, 0, 1), 8, 90)
    block, shaft = box((-20, -20, 0), (20, 20, 20)), cylinder((0, 0, 0), (0, 0, 1), 8, 40)
    ring = without(cylinder((0, 0, -1), (0, 0, 1), 12, 30), cylinder((0, 0, -2), (0, 0, 1), 8, 40))
    sectors = [box((2, 2, -9), (30, 30, 50)), box((-30, -30, -9), (-2, -2, 50))]
    common = kernel["BRepAlgoAPI"].BRepAlgoAPI_Common
    shapes = {
        "halves": lambda: without(block, hole),
        "thirds": lambda: without(block, hole),
        "mirrored": lambda: without(block, hole),
        "keyway": lambda: without(block, hole, box((-2, 5, -1), (2, 12, 30))),
        "two keyways": lambda: without(block, hole, box((-2, -12, -1), (2, 12, 30))),
        "four keyways": lambda: without(block, hole, box((-2, -12, -1), (2, 12, 30)), box((-12, -2, -1), (12, 2, 30))),
        "splined shaft": lambda: without(shaft, box((-2, 6, -1), (2, 12, 50)), box((-2, -12, -1), (2, -6, 50))),
        "cross hole": lambda: without(block, hole, cylinder((0, 0, 10), (1, 0, 0), 3, 40)),
        "lugs": lambda: without(box((-20, -20, 0), (20, 20, 40)), box((-10, -30, 15), (30, 30, 25)), hole),
        "curved slots": lambda: without(block, *(common(ring, sector).Shape() for sector in sectors)),
    }
    shape = shapes[name]()
    angle = 120 if name == "thirds" else 180
    divided = kernel["ShapeUpgrade"].ShapeUpgrade_ShapeDivideAngle(np.radians(angle), shape)
    divided.Perform()
    shape = divided.Result()
    if name == "mirrored":
        mirror = gp.gp_Trsf()
        mirror.SetMirror(gp.gp_Ax2(gp.gp_Pnt(0, 0, 0), gp.gp_Dir(1, 0, 0)))
        shape = kernel["BRepBuilderAPI"].BRepBuilderAPI_Transform(shape, mirror, True).Shape()
    writer = kernel["STEPControl"].STEPControl_Writer()
    writer.Transfer(shape, kernel["STEPControl"].STEPControl_AsIs)
    path = tmp_path / f"{name}.stp"
    writer.Write(str(path))
    return path


COMMON = ("two keyways", "lugs", "curved slots")  # of each kind one
WHOLES = {  # radii of whole cylinders, and numbers of their faces
    "halves": [(8, 2)],
    "thirds": [(8, 3)],
    "mirrored": [(8, 2)],
    "keyway": [(8, 3)],
    "two keyways": [(8, 3)],
    "four keyways": [(8, 4)],
    "splined shaft": [(8, 3)],
    "cross hole": [(3, 2), (8, 2)],
    "lugs": [(8, 2), (8, 2)],
    "curved slots": [(8, 1), (8, 1), (12, 1), (12, 1)],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", [*COMMON, *nightly(*(name for name in WHOLES if name not in COMMON))])
def test_faces_of_one_cylinder_are_whole_and_others_are_not(name, tmp_path):
    path = written_step(tmp_path, name)
    faces = [face for face in tc.faces_in(path) if face.kind == "cylinder"]
    wholes = {face.whole or (face.number,) for face in faces}
    radius = {face.number: face.radius for face in faces}
    assert sorted((round(radius[whole[0]]), len(whole)) for whole in wholes) == WHOLES[name]
    for whole in wholes:
        model = tc.Assembly(name)
        part = model.part("body", tc.Mesh(path), fixed=True)
        part.feature("round", part.face(tc.Brep(whole[0])), tc.Size(2 * radius[whole[0]], 0.1))
        model.measure("nothing", part.point(0, 0, 0), along="z")
        with warnings.catch_warnings(record=True) as records:
            warnings.simplefilter("always", tc.FaceWarning)
            discretize(model)
        texts = [str(record.message) for record in records if record.category is tc.FaceWarning]
        assert len(texts) == (len(whole) > 1)
        assert all(f"1 of the {len(whole)} faces of one cylinder" in text for text in texts)
