"""Several B-rep faces as one face: unions, and holes that a file splits into halves."""

import functools
import warnings
from pathlib import Path

import numpy as np
import pytest

import tolcontact as tc
from tests.cases import MODELS
from tests.helpers import FIXED, assembly_of, call, nightly
from tests.shapes import triangles_of
from tests.test_json_models import written
from tolcontact.discretization import discretize
from tolcontact.errors import GeometryFault
from tolcontact.geometry import preview

AS1 = Path(__file__).resolve().parents[1] / "studies" / "cad" / "as1-oc-214.stp"
HALVES = [(6, 7), (8, 9), (10, 11), (12, 13), (14, 15), (16, 17)]  # of the plate's six holes


def plate_with(*selections, **toleranced):
    model = tc.Assembly("plate")
    plate = model.part("plate", tc.Mesh(AS1, body="plate_1"), fixed=True)
    plate.feature("top", plate.face(tc.select.Brep(1)), datum="A")
    feature = plate.feature("hole", plate.face(*selections), tc.Size(10, 0.1, -0.1), tc.Position(0.2, "A"))
    model.measure("corner", of=plate.point(0, 0, 0), along="z")
    return model, plate, feature


@functools.cache
def discretized_plate():
    model, plate, _ = plate_with(tc.select.Brep(6, whole=True))
    return discretize(model), plate


def chosen(selection):
    nominal, plate = discretized_plate()
    return list(nominal.triangles(plate.face(selection)))


def test_a_union_has_the_triangles_of_all_its_faces():
    apart = [set(chosen(tc.select.Brep(number))) for number in (3, 7, 12)]
    assert set(chosen(tc.select.Brep(3, 7, 12))) == set.union(*apart) and sum(map(len, apart)) == len(set.union(*apart))
    assert (
        chosen(tc.select.Brep(3) | tc.select.Brep(7, 12))
        == chosen(tc.select.Brep(12, 3, 7))
        == chosen(tc.select.Brep(12, 7) | tc.select.Brep((180, 100, 13.33)))
    )
    with pytest.raises(TypeError, match="whole for both, or for none"):
        tc.select.Brep(3) | tc.select.Brep(6, whole=True)
    assert tc.select.Brep(np.int64(3), np.array([1.0, 2.0, 3.0])).which == (3, (1.0, 2.0, 3.0))
    assert "need numbers" in next(tc.select.Brep().faults())


def test_halves_of_a_hole_are_one_surface_by_each_of_their_numbers():
    faces = tc.io.faces_in(AS1, "plate_1")
    assert [face.whole for face in faces] == [(), (), (), (), (), *(pair for pair in HALVES for _ in pair), ()]
    assert "one surface with 7" in str(faces[5])
    for pair in HALVES:
        both = chosen(tc.select.Brep(*pair))
        point = faces[pair[0] - 1].point
        assert all(chosen(tc.select.Brep(which, whole=True)) == both for which in (*pair, point))
    assert chosen(tc.select.Brep(1, whole=True)) == chosen(tc.select.Brep(1))


def test_a_feature_on_half_a_hole_is_doubted_and_a_whole_one_has_its_axis():
    with pytest.warns(
        tc.NominalWarning, match=r'\[face\] .*"hole".*1 of the 2 faces of one cylinder.*tc.select.Brep\(6, whole=True\)'
    ):
        tc.build(plate_with(tc.select.Brep(6))[0])
    with warnings.catch_warnings():
        warnings.filterwarnings("error", r"\[face\]")
        whole = tc.build(plate_with(tc.select.Brep(7, whole=True))[0]).nominal
        tc.build(plate_with(tc.select.Brep(6, 7))[0])
        tc.build(
            plate_with(tc.select.Brep(6), tc.select.Inside((0, 0, 2), (200, 200, 18)))[0]
        )  # a part of the hole is what was asked for
    hole = next(nominal for nominal in whole.features if nominal.feature.name == "hole")
    assert np.allclose(hole.geometry.centre[:2], [47.5, 75 + 7.5 * 3**0.5], atol=1e-5)
    with pytest.raises(tc.ModelError, match="spans more than one surface"):
        discretize(plate_with(tc.select.Brep(6, 8, whole=True))[0])


def test_unions_and_whole_surfaces_come_with_json(tmp_path):
    model, _, _ = plate_with(tc.select.Brep(6, (47.46, 82.99, 6.667), whole=True))
    document = written(model, tmp_path / "first.json")
    again = assembly_of(tmp_path / "first.json")
    assert again.parts[0].features[1].faces[0].selections == (tc.select.Brep(6, (47.46, 82.99, 6.667), whole=True),)
    assert written(again, tmp_path / "second.json") == document
    text = (tmp_path / "first.json").read_text()
    for wrong in ('"all"', '"any ones"'):
        (tmp_path / "wrong.json").write_text(text.replace('"any"', wrong))
        with pytest.raises(tc.TolcontactError, match='faces under the key "any"'):
            assembly_of(tmp_path / "wrong.json")


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

    def slot_tools(start, end, y):
        ends = [cylinder((x, y, -1), (0, 0, 1), 5, 20) for x in (end, start)]
        return [*ends, box((start, y - 5, -1), (end, y + 5, 20))]

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
        "drilled plate": lambda: without(
            box((0, 0, 0), (120, 60, 10)),
            *(cylinder((x, y, -1), (0, 0, 1), 4, 20) for x in (10, 30) for y in (10, 30)),
            cylinder((-1, 50, 5), (1, 0, 0), 4, 20),
            cylinder((20, 20, -1), (0, 0, 1), 6, 20),
            *(tool for x in (50, 80) for tool in slot_tools(x, x + 15, 40)),
            *slot_tools(50, 130, 10)[1:],
        ),
    }
    shape = shapes[name]()
    angle = {"thirds": 120, "drilled plate": 90}.get(name, 180)
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
    faces = [face for face in tc.io.faces_in(path) if face.kind == "cylinder"]
    wholes = {face.whole or (face.number,) for face in faces}
    radius = {face.number: face.radius for face in faces}
    assert sorted((round(radius[whole[0]]), len(whole)) for whole in wholes) == WHOLES[name]
    for whole in wholes:
        model = tc.Assembly(name)
        part = model.part("body", tc.Mesh(path), fixed=True)
        part.feature("round", part.face(tc.select.Brep(whole[0])), tc.Size(2 * radius[whole[0]], 0.1))
        model.measure("nothing", part.point(0, 0, 0), along="z")
        with warnings.catch_warnings(record=True) as records:
            warnings.simplefilter("always", tc.NominalWarning)
            tc.build(model)
        texts = [text for record in records if (text := str(record.message)).startswith("[face]")]
        assert len(texts) == (len(whole) > 1)
        assert all(f"1 of the {len(whole)} faces of one cylinder" in text for text in texts)


@pytest.mark.slow
def test_slots_and_patterns_of_made_holes_are_listed_and_others_are_not(tmp_path):
    path = written_step(tmp_path, "drilled plate")  # quarters of cylinders; the two slots have walls in the same planes
    faces = tc.io.faces_in(path)
    slots, patterns = ({getattr(face, word) for face in faces} - {()} for word in ("slot", "pattern"))
    places = {tuple(sorted({round(faces[n - 1].centre[0]) for n in slot if faces[n - 1].centre})) for slot in slots}
    assert places == {(50, 65), (80, 95)} and {len(slot) for slot in slots} == {2 + 2 * 2}
    (pattern,) = patterns  # neither the hole across, nor the larger one, nor the end of the open slot
    axes = {tuple(np.round(faces[n - 1].centre[:2], 6)) for n in pattern}
    assert axes == {(x, y) for x in (10.0, 30.0) for y in (10.0, 30.0)} and len(pattern) == 16
    assert {faces[n - 1].radius for n in pattern} == {4.0}


def test_holes_by_hand_are_the_patterns_of_an_assembly():
    for body, count in {"plate_1": 6, "l-bracket_1": 3, "nut_1": 0}.items():
        faces = tc.io.faces_in(AS1, body)
        patterns = {face.pattern for face in faces} - {()}
        assert not any(face.slot for face in faces)
        assert [len(pattern) for pattern in patterns] == [2 * count] * (count > 0)
    assert chosen(tc.select.Brep(9, whole="pattern")) == chosen(tc.select.Brep(*range(6, 18)))


def test_a_slot_is_chosen_by_any_of_its_faces():
    part = tc.Assembly("cover").part("cover", tc.Mesh(MODELS / "cover.step"))
    slot = [12, 13, 14, 15]
    selections = [tc.select.Brep(*slot), *(tc.select.Brep(number, whole="slot") for number in slot)]
    masks = {tuple(triangles_of(part.face(selection))) for selection in selections}
    assert len(masks) == 1
    image = preview(part)
    for number in slot:
        (snippet,) = image.groups[number - 1]
        assert tuple(triangles_of(eval(f"part.{snippet}", {"part": part, "tc": tc}))) in masks
    assert str(part.face(tc.select.Brep(12, whole="slot"))) == "cover slot of B-rep face 12"
    with pytest.raises(GeometryFault, match=r"face 1 belongs to no slot; slot, radius 4.05 mm, faces 12, 13, 14, 15: tc"):
        triangles_of(part.face(tc.select.Brep(1, whole="slot")))
    assert "expected True, False, 'slot' or 'pattern'" in next(tc.select.Brep(1, whole="pocket").faults())


def test_a_pattern_comes_with_json(tmp_path):
    model = tc.Assembly("plate", method=FIXED)
    plate = model.part("plate", tc.Mesh(AS1, body="plate_1"), fixed=True)
    pin = model.part("pin", tc.Pin(9.8, 20, False), at=(25, 75, 20))
    places = [((0, 0, 0), "x"), ((0, 0, 0), "y"), ((0, 0, 0), "z"), ((9, 0, 0), "y"), ((9, 0, 0), "z"), ((0, 9, 0), "z")]
    model.locate(pin, [tc.Locator(f"L{k}", *place, 0.1) for k, place in enumerate(places)])
    holes = plate.face(tc.select.Brep(6, (23.54, 79.78, 6.667), whole="pattern"))
    model.contact("pin in the holes", moving=pin.face(), reference=holes)
    model.measure("height", pin.point(0, 0, 0), along="z")
    written(model, tmp_path / "pattern.json")
    assert assembly_of(tmp_path / "pattern.json").pairs[0].reference.selections == holes.selections


def test_the_list_states_axes_slots_and_patterns():
    lines = call(MODELS, "faces", "cover.step").stdout.splitlines()
    assert lines[-1] == 'slot, radius 4.05 mm, faces 12, 13, 14, 15: tc.select.Brep(12, whole="slot")'
    assert "axis through (106.7483, 65.97129, 5.333333), along (0, 0, -1)" in lines[14]
