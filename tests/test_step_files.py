"""STEP files as strangers send them: one body is read, several are listed, what is missing is named."""

import re

import numpy as np
import pytest

import tolcontact as tc
from tests.helpers import simulate
from tests.shapes import patch, refusal, shape
from tests.step_files import Step, assembly, corners, step_block, step_of
from tolcontact.discretization import discretize

SEVERAL = {
    "solids apart": (
        step_of(("solid", (0, 0, 0), (10, 20, 30), r"Geh\X2\00E4\X0\use"), ("solid", (50, 0, 0), (51, 1, 1), "right")),
        ['1. "Gehäuse", 10 x 20 x 30 mm at (5, 10, 15)', '2. "right", 1 x 1 x 1 mm at (50.5, 0.5, 0.5)'],
    ),
    "solids that touch": (
        step_of(("solid", (0, 0, 0), (10, 10, 10), "left"), ("solid", (10, 0, 0), (20, 10, 10), "right")),
        ['1. "left", 10 x 10 x 10 mm at (5, 5, 5)', '2. "right", 10 x 10 x 10 mm at (15, 5, 5)'],
    ),
    "a solid in the cavity of another one, which it fills": (
        step_of(
            ("solid", (0, 0, 0), (30, 30, 30), "around", ((10, 10, 10), (20, 20, 20))),
            ("solid", (10, 10, 10), (20, 20, 20), "within"),
        ),
        ['1. "around", 30 x 30 x 30', '2. "within", 10 x 10 x 10 mm at (15, 15, 15)'],
    ),
    "a solid and a sheet": (
        step_of(("solid", (0, 0, 0), (10, 10, 10)), ("sheet", (20, 0, 0), 10)),
        ["10 x 10 x 10 mm", "2. open, ", "10 x 10 x 0 mm at (25, 5, 0)"],
    ),
}


LONG = "\x1b[31m red \n" + 300 * "long "
REFUSED = {
    **{kind: content for kind, (content, _) in SEVERAL.items()},
    "long names": step_of(("solid", (0, 0, 0), (1, 1, 1), LONG), ("solid", (2, 0, 0), (3, 1, 1), LONG)),
    "two pins": assembly(("pin", (0, 0, 0)), ("pin", (5, 0, 0))),
    "a set and a pin": assembly(("set", (0, 0, 0)), ("pin", (50, 0, 0))),
    "many": step_of(*[("solid", (2 * k, 0, 0), (2 * k + 1, 1, 1)) for k in range(15)]),
    "without a face": re.sub(r"PLANE\('',#\d+\)", "PLANE('',#1)", step_block(), count=1),
}


def model_of(contents, folder):
    """A model whose fixed parts are of files of some contents, by name: one process reads all of them."""
    model = tc.Assembly("files")
    for name, content in contents.items():
        path = folder / f"{name}.step"
        path.write_text(content)
        part = model.part(name, tc.Mesh(path), fixed=True)
    model.measure("x", part.point(0, 0, 0), along="x")
    return model


@pytest.fixture(scope="module")
def refusals(tmp_path_factory):
    """What is said of each file, by the name of its part."""
    faults = tc.check(model_of(REFUSED, tmp_path_factory.mktemp("refused")))
    assert len(faults) == len(REFUSED) and all(len(fault) < 2500 and "\n" not in fault for fault in faults)
    found = {name: [fault for fault in faults if f'part "{name}"' in fault] for name in REFUSED}
    assert all(f"{name}.step" in fault for name, (fault,) in found.items())
    return {name: fault for name, (fault,) in found.items()}


@pytest.mark.slow
@pytest.mark.parametrize("kind", SEVERAL)
def test_a_step_file_of_several_bodies_is_refused_with_their_list(kind, refusals):
    said, (_, expected) = refusals[kind], SEVERAL[kind]
    assert "holds 2 bodies" in said and "or declare all with tc.io.parts_from" in said
    for words in expected:
        assert words in said


def test_names_in_a_file_do_not_spoil_a_message(refusals):
    said = refusals["long names"]
    assert "\x1b" not in said and "[31m red long long" in said and len(said) < 500


def test_the_bodies_of_an_assembly_stand_in_their_places(refusals):
    said = refusals["two pins"]
    assert "holds 2 bodies" in said
    assert '1. "use 0", 5 x 5 x 5 mm at (2.5, 2.5, 2.5)' in said and '2. "use 1", 5 x 5 x 5 mm at (7.5, 2.5, 2.5)' in said


def test_touching_solids_of_one_product_are_told_apart(refusals):
    said = refusals["a set and a pin"]
    assert "holds 4 bodies" in said
    places = ("10 x 10 x 10 mm at (5, 5, 5)", "10 x 10 x 10 mm at (15, 5, 5)", "30 x 30 x 30 mm at (15, 15, 35)")
    for place in (*places, "5 x 5 x 5 mm at (52.5, 2.5, 2.5)"):
        assert place in said


def test_many_bodies_are_counted_and_the_first_of_them_listed(refusals):
    said = refusals["many"]
    assert "holds 15 bodies" in said and "12. without a name" in said and said.endswith("and 3 more (see tolcontact bodies)")


ONE = {
    "a solid": (step_block(), 6000, True),
    "a cavity": (step_of(("solid", (0, 0, 0), (30, 30, 30), "", ((10, 10, 10), (20, 20, 20)))), 26000, True),
    "a sheet": (step_of(("sheet", (0, 0, 0), 10)), None, False),
    "sheets that are not sewn": (step_of(("sheet", (0, 0, 0), 10), ("sheet", (20, 0, 0), 10)), None, False),
    "an assembly of one": (assembly(("pin", (7, 0, 0))), 125, True),
}


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    """The mesh of each file, by the name of its part."""
    model = model_of({kind: content for kind, (content, _, _) in ONE.items()}, tmp_path_factory.mktemp("one"))
    return {part.part.name: part.mesh for part in discretize(model).parts}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ONE)
def test_one_body_is_read_whatever_it_consists_of(kind, meshes):
    (_, volume, closed), mesh = ONE[kind], meshes[kind]
    assert mesh.is_watertight == closed
    assert volume is None or mesh.volume == pytest.approx(volume)


def test_edges_shorter_than_can_be_resolved_do_no_harm(tmp_path):
    """The corners of a block of 1 m, each cut off by as little as CAD kernels leave by mistake."""
    made = Step()
    size, cut = 1000.0, 2e-6
    cornered, faces = cut_corner(size, cut)
    made.product("cut", [made.add(f"MANIFOLD_SOLID_BREP('',#{made.shell(cornered, faces=faces)})")])
    (tmp_path / "cut.step").write_text(str(made))
    mesh = shape(tc.Mesh(tmp_path / "cut.step"))
    assert mesh.is_watertight and mesh.volume == pytest.approx(size**3)
    assert (mesh.area_faces > 0).all()


def cut_corner(size, cut):
    """Corners and faces of a block, whose corner at the top is cut off by a small triangle."""
    eight = corners((0, 0, 0), (size, size, size))
    own = [*eight[:6], (size - cut, size, size), eight[7], (size, size - cut, size), (size, size, size - cut)]
    faces = [(0, 3, 2, 1), (4, 5, 8, 6, 7), (0, 1, 5, 4), (1, 2, 9, 8, 5), (2, 3, 7, 6, 9), (3, 0, 4, 7), (6, 8, 9)]
    return own, faces


def test_a_solid_that_lost_a_face_is_not_taken_for_a_sheet(refusals):
    said = refusals["without a face"]
    assert "do not close" in said and "5 of 6 faces" in said


def external(name):
    made = Step()
    definition, _ = made.product("whole")
    kind = made.add("DOCUMENT_TYPE('geometry')")
    document = made.add(f"DOCUMENT_FILE('{name}','','',#{kind},'',$)")
    made.add(f"APPLIED_DOCUMENT_REFERENCE(#{document},'',(#{definition}))")
    return made


def test_shapes_in_other_files_are_named(tmp_path):
    said = refusal(tmp_path / "top.step", str(external("lid.stp")))
    assert '"lid.stp"' in said and "other files" in said
    part = external("lid.stp")
    part.product("part", [part.solid((0, 0, 0), (10, 10, 10))])
    assert '"lid.stp"' in refusal(tmp_path / "top and part.step", str(part))
    drawing = external("drawing.pdf")
    drawing.product("part", [drawing.solid((0, 0, 0), (10, 10, 10))])
    (tmp_path / "drawn.step").write_text(str(drawing))
    assert shape(tc.Mesh(tmp_path / "drawn.step")).is_watertight


def test_coloured_faces_of_a_step_file_are_still_faces(tmp_path):
    made = Step()
    shell = made.shell(corners((0, 0, 0), (10, 20, 30)))
    made.product("painted", [made.add(f"MANIFOLD_SOLID_BREP('',#{shell})")])
    made.paint(shell, red=1.0)
    (tmp_path / "painted.step").write_text(str(made))
    part = tc.Assembly("painted").part("block", tc.Mesh(tmp_path / "painted.step"))
    meshes = {part: shape(part.geometry)}
    for at, area in (((5, 10, 0), 200), ((5, 10, 30), 200), ((0, 10, 15), 600), ((5, 0, 15), 300)):
        assert patch(part.face(tc.select.Brep(at)), meshes).mesh.area == pytest.approx(area)


def test_a_face_that_stands_twice_counts_once(tmp_path, caplog):
    made = Step()
    shell = made.shell(corners((0, 0, 0), (10, 20, 30)))
    made.double(shell)
    made.product("twice", [made.add(f"MANIFOLD_SOLID_BREP('',#{shell})")])
    (tmp_path / "twice.step").write_text(str(made))
    with caplog.at_level("INFO"):
        mesh = shape(tc.Mesh(tmp_path / "twice.step"))
    assert mesh.is_watertight and mesh.volume == pytest.approx(6000) and len(tc.io.faces_in(tmp_path / "twice.step")) == 6
    assert "2 triangles that stand twice are left out" in caplog.text


def test_components_of_an_assembly_have_units_of_their_own(tmp_path):
    """A block in inches in an assembly in mm, one in mm in an assembly in inches, and an image by an operator in inches."""
    made, path = Step(), tmp_path / "mixed.step"
    inches = made.context_in(made.inch())
    inch_block = made.product("inch block", [made.solid((0, 0, 0), (1, 2, 3))], inches)
    block = made.product("block", [made.solid((0, 0, 0), (1, 2, 3))])
    inner, whole = made.product("inner", (), inches), made.product("whole")
    made.place(inch_block, whole, "in mm", (10, 0, 0))
    made.place(block, inner, "in inches", (2, 0, 0))
    mirror = np.array([[-1, 0, 0, 4], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    made.place(block, inner, "mirrored", operator=made.operator(mirror))
    made.place(inner, whole, "inner", (0, 100, 0))
    path.write_text(str(made))
    boxes = {body.name: np.array([body.lower, body.upper]) for body in tc.io.bodies_in(path)}
    expected = {
        "in mm": [(10, 0, 0), (35.4, 50.8, 76.2)],
        "in inches": [(50.8, 100, 0), (51.8, 102, 3)],
        "mirrored": [(100.6, 100, 0), (101.6, 102, 3)],
    }
    assert boxes == {name: pytest.approx(np.array(box), abs=1e-9) for name, box in expected.items()}
    assert {body.units for body in tc.io.bodies_in(path)} == {"inch, millimetre"}
    model = tc.Assembly("mixed", units="in")
    parts = tc.io.parts_from(model, path, fixed=True)
    model.measure("end", parts["in mm"].point(25.4, 0, 0), to=parts["mirrored"].point(0, 0, 0), along="x")
    assert simulate(model, samples=1)[1]["measured"][0, 1, 0] == pytest.approx((101.6 - 35.4) / 25.4, abs=1e-9)
