"""Names that a STEP file gives to faces: those of the right faces, or none."""

import itertools
import re

import numpy as np
import pytest

import tolcontact as tc
from tests.helpers import assembly_of, call, compiled
from tests.step_files import Step, assembly, corners, step_of
from tests.test_cad import COVER
from tests.test_json_models import written
from tolcontact.discretization import discretize
from tolcontact.errors import GeometryFault

DIRECTIONS = ("-z", "+z", "-y", "+x", "+y", "-x")  # of a block's faces, in their order


def named(text, names):
    """A STEP file whose faces are called something, in the order in which they stand in it."""
    given = itertools.chain(names, itertools.repeat(""))
    return re.sub(r"ADVANCED_FACE\(''", lambda _: f"ADVANCED_FACE('{next(given)}'", text)


def counted(text):
    """A STEP file whose faces are called f0, f1, ..."""
    return named(text, (f"f{k}" for k in itertools.count()))


def one_block(path, names):
    path.write_text(named(step_of(("solid", (0, 0, 0), (10, 20, 30))), names))
    model = tc.Assembly("one")
    block = model.part("block", tc.Mesh(path), fixed=True)
    model.measure("corner", block.point(0, 0, 0), along="z")
    return model, block


def test_faces_are_chosen_by_their_names(tmp_path):
    odd = r"w\X2\00E4\X0\nde; #12=PLANE(''"
    model, block = one_block(tmp_path / "named.step", ["seat", "NONE", "side", odd, "side", " "])
    nominal = discretize(model)
    for name, words in (("seat", ["-z"]), ("side", ["-y", "+y"]), ("wände; #12=PLANE('", ["+x"])):
        expected = sorted(itertools.chain(*(nominal.triangles(block.face(word)) for word in words)))
        assert sorted(nominal.triangles(block.face(tc.select.Brep(name)))) == expected
    with pytest.raises(
        GeometryFault, match="face block B-rep face 'lid': the part has no such face; its faces are called \"seat\""
    ):
        nominal.triangles(block.face(tc.select.Brep("lid")))
    assert "empty name" in next(tc.select.Brep("").faults())
    assert [face.name for face in tc.io.faces_in(tmp_path / "named.step")][1::4] == ["", ""]
    listed = call(tmp_path, "faces", "named.step").stdout.splitlines()
    assert listed[0].startswith('1. "seat", plane, along (0, 0, -1)') and listed[1].startswith("2. plane")


def test_a_file_without_names_says_so():
    model = tc.Assembly("one")
    cover = model.part("cover", tc.Mesh(COVER), fixed=True)
    model.measure("corner", cover.point(0, 0, 0), along="z")
    with pytest.raises(GeometryFault, match="its file gives no face of it a name"):
        discretize(model).triangles(cover.face(tc.select.Brep("hole")))


@pytest.mark.slow
def test_names_come_with_the_archive(tmp_path):
    model, block = one_block(tmp_path / "named.step", [f"to {way}" for way in DIRECTIONS])
    pin = model.part("pin", tc.Box(4, 4, 4), at=(3, 8, 30))
    model.locate(pin, tc.three_two_one(pin.face("-z"), pin.face("-y"), pin.face("-x"), inset=0.5), tolerance=0.2)
    model.contact("seat", moving=pin.face("-z"), reference=block.face(tc.select.Brep("to +z")))
    with tc.run(compiled(model, solver="daqp"), samples=50, seed=1, out=tmp_path / "run.nc") as results:
        seat = discretize(model).triangles(block.face(tc.select.Brep("to +z")))
        (tmp_path / "named.step").unlink()
        rebuilt = tc.io.model_of(results)
        assert discretize(rebuilt).triangles(rebuilt.parts[0].face(tc.select.Brep("to +z"))) == seat
        again = tc.run(compiled(tc.io.model_of(results), solver="daqp"), samples=50, seed=1)
        assert again.measured.equals(results.measured) and again.gap_min.equals(results.gap_min)


def test_names_come_with_json(tmp_path):
    model, block = one_block(tmp_path / "named.step", DIRECTIONS)
    pin = model.part("pin", tc.Box(4, 4, 4), at=(3, 8, 30))
    model.locate(pin, tc.three_two_one(pin.face("-z"), pin.face("-y"), pin.face("-x"), inset=0.5), tolerance=0.2)
    model.contact("seat", moving=pin.face("-z"), reference=block.face(tc.select.Brep("+z")))
    document = written(model, tmp_path / "first.json")
    again = assembly_of(tmp_path / "first.json")
    assert again.pairs[0].reference.selections == (tc.select.Brep("+z"),)
    assert written(again, tmp_path / "second.json") == document


def names_in(path, text, *bodies):
    path.write_text(text)
    return [[face.name for face in tc.io.faces_in(path, number)] for number in bodies]


@pytest.mark.slow
def test_bodies_of_an_assembly_have_their_own_names(tmp_path):
    path, several = tmp_path / "stack.step", [[f"f{k}" for k in part] for part in (range(6), range(6, 12), range(12, 24))]
    assert names_in(path, counted(assembly(("set", (0, 0, 0)))), 1, 2, 3) == several
    assert names_in(path, named(assembly(("pin", (0, 0, 0)), ("pin", (0, 0, 5))), DIRECTIONS), 1, 2) == 2 * [list(DIRECTIONS)]
    later = [[f"f{k + 6}" for k in range(12, 24)]]
    assert names_in(path, counted(assembly(("pin", (0, 0, 0)), ("set", (100, 0, 0)))), 1, 4) == several[:1] + later


@pytest.mark.slow
def test_names_of_solids_that_are_alike_are_told_apart(tmp_path):
    """Of solids that are alike in their own frames, but not in their names; of a shell that has a face twice."""
    made, path = Step(), tmp_path / "alike.step"
    solids = [made.solid((0, 0, 0), (5, 5, 5)) for _ in range(2)]
    whole = made.product("whole")
    for k, solid in enumerate(solids):
        made.place(made.product(f"pin {k}", [solid]), whole, f"pin {k}", (10 * k, 0, 0))
    assert names_in(path, counted(str(made)), 1, 2) == [[f"f{k}" for k in part] for part in (range(6), range(6, 12))]
    twice = Step()
    shell = twice.shell(corners((0, 0, 0), (10, 20, 30)))
    twice.double(shell)
    twice.product("twice", [twice.add(f"MANIFOLD_SOLID_BREP('',#{shell})")])
    path.write_text(named(str(twice), DIRECTIONS))
    found = {face.name: face.direction for face in tc.io.faces_in(path)}  # the kernel moves a face to the end
    assert found == {name: pytest.approx(np.eye(3)["xyz".index(name[1])] * float(f"{name[0]}1")) for name in DIRECTIONS}


@pytest.mark.slow
@pytest.mark.parametrize(("assigned", "size"), [("inch", 25.4), ("millimetre", 1.0)])
def test_surfaces_are_compared_in_the_units_of_the_shapes(assigned, size, tmp_path):
    """Inches are defined by mm, and a file in mm may state other lengths in inches."""
    made = Step()
    number = next(k for k, line in enumerate(made.lines, start=1) if "LENGTH_UNIT" in line)
    millimetre = made.add(made.lines[number - 1])
    length = made.add("DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)")
    measure = made.add(f"LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#{millimetre})")
    inch = f"(CONVERSION_BASED_UNIT('inch',#{measure})LENGTH_UNIT()NAMED_UNIT(#{length}))"
    if assigned == "inch":
        made.lines[number - 1] = inch
    else:
        made.add(inch)
    made.product("block", [made.solid((1, 1, 1), (2, 3, 4))])
    assert names_in(tmp_path / "inches.step", named(str(made), DIRECTIONS), 1) == [list(DIRECTIONS)]
    (body,) = tc.io.bodies_in(tmp_path / "inches.step")
    assert body.units == assigned and body.upper == pytest.approx((2 * size, 3 * size, 4 * size))


def test_faces_of_several_colours_have_their_names(tmp_path):
    made = Step()
    shell = made.shell(corners((0, 0, 0), (10, 20, 30)))
    made.product("painted", [made.add(f"MANIFOLD_SOLID_BREP('',#{shell})")])
    made.paint(shell, red=1.0)
    (tmp_path / "painted.step").write_text(named(str(made), DIRECTIONS))
    assert [face.name for face in tc.io.faces_in(tmp_path / "painted.step")] == list(DIRECTIONS)


def test_faces_beside_a_drawing_have_their_names(tmp_path):
    """The representation of a part refers to its solid and, as those of some systems do, to the lines of a drawing."""
    step = Step()
    solid = step.solid((0, 0, 0), (10, 20, 30), "block")
    ends = ",".join(f"#{step.point((x, 0, 50))}" for x in (0, 10))
    line = step.add(f"POLYLINE('',({ends}))")
    lines = step.add(f"GEOMETRIC_CURVE_SET('',(#{line}))")
    _, part = step.product("part")
    for kind, item in (("ADVANCED_BREP", solid), ("GEOMETRICALLY_BOUNDED_WIREFRAME", lines)):
        shape = step.add(f"{kind}_SHAPE_REPRESENTATION('',(#{step.placement()},#{item}),#{step.context})")
        step.add(f"SHAPE_REPRESENTATION_RELATIONSHIP('','',#{part},#{shape})")
    (tmp_path / "drawn.step").write_text(counted(str(step)))
    assert [face.name for face in tc.io.faces_in(tmp_path / "drawn.step")] == [f"f{number}" for number in range(6)]
