"""Names that a STEP file gives to faces: those of the right faces, or none."""

import itertools
import re

import pytest
from typer.testing import CliRunner

import tolcontact as tc
from tests.step_files import Step, assembly, corners, step_of
from tests.test_cad import COVER
from tolcontact.cli.app import app
from tolcontact.discretization import discretize
from tolcontact.discretization.fault import GeometryFault

DIRECTIONS = ("-z", "+z", "-y", "+x", "+y", "-x")  # of a block's faces, in their order


def named(text, names):
    """A STEP file whose faces are called something, in the order in which they stand in it."""
    given = itertools.chain(names, itertools.repeat(""))
    return re.sub(r"ADVANCED_FACE\(''", lambda _: f"ADVANCED_FACE('{next(given)}'", text)


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
        assert sorted(nominal.triangles(block.face(tc.Brep(name)))) == expected
    with pytest.raises(
        GeometryFault, match="face block B-rep face 'lid': the part has no such face; its faces are called \"seat\""
    ):
        nominal.triangles(block.face(tc.Brep("lid")))
    assert "empty name" in next(tc.Brep("").faults())
    assert [face.name for face in tc.faces_in(tmp_path / "named.step")][1::4] == ["", ""]
    listed = CliRunner().invoke(app, ["faces", str(tmp_path / "named.step")]).stdout.splitlines()
    assert listed[0].startswith('1. "seat", plane, along (0, 0, -1)') and listed[1].startswith("2. plane")


def test_a_file_without_names_says_so():
    model = tc.Assembly("one")
    cover = model.part("cover", tc.Mesh(COVER), fixed=True)
    model.measure("corner", cover.point(0, 0, 0), along="z")
    with pytest.raises(GeometryFault, match="its file gives no face of it a name"):
        discretize(model).triangles(cover.face(tc.Brep("hole")))


def test_names_come_with_the_archive(tmp_path):
    model, block = one_block(tmp_path / "named.step", [f"to {way}" for way in DIRECTIONS])
    pin = model.part("pin", tc.Box(4, 4, 4), at=(3, 8, 30))
    model.locate(pin, tc.three_two_one(pin.face("-z"), pin.face("-y"), pin.face("-x"), inset=0.5), tolerance=0.2)
    model.contact("seat", moving=pin.face("-z"), reference=block.face(tc.Brep("to +z")))
    with tc.run(model, samples=50, seed=1, out=tmp_path / "run.nc", solver="daqp") as results:
        (tmp_path / "named.step").unlink()
        again = tc.run(tc.model_of(results), samples=50, seed=1, solver="daqp")
        assert again.measured.equals(results.measured) and again.gap_min.equals(results.gap_min)


def test_bodies_of_an_assembly_have_their_own_names(tmp_path):
    """The pin's six faces, then those of three solids; two of these are alike, but not in their names."""
    numbers = itertools.count()
    path = tmp_path / "stack.step"
    path.write_text(re.sub(r"ADVANCED_FACE\(''", lambda _: f"ADVANCED_FACE('f{next(numbers)}'", assembly(("set", (0, 0, 0)))))
    found = [[face.name for face in tc.faces_in(path, number)] for number in (1, 2, 3)]
    assert found == [[f"f{k}" for k in part] for part in (range(6), range(6, 12), range(12, 24))]
    path.write_text(named(assembly(("pin", (0, 0, 0)), ("pin", (0, 0, 5))), DIRECTIONS))
    for number in (1, 2):
        assert [face.name for face in tc.faces_in(path, number)] == list(DIRECTIONS)
    # In an assembly, where blocks could be either of two, no name is given.
    numbers = itertools.count()
    text = assembly(("pin", (0, 0, 0)), ("set", (100, 0, 0)))
    path.write_text(re.sub(r"ADVANCED_FACE\(''", lambda _: f"ADVANCED_FACE('f{next(numbers)}'", text))
    assert {face.name for face in tc.faces_in(path, 1)} == {""}
    assert [face.name for face in tc.faces_in(path, 4)] == [f"f{k}" for k in range(18, 30)]


def test_faces_that_are_out_of_order_have_no_names(tmp_path):
    made = Step()
    shell = made.shell(corners((0, 0, 0), (10, 20, 30)))
    made.product("painted", [made.add(f"MANIFOLD_SOLID_BREP('',#{shell})")])
    made.paint(shell, red=1.0)
    (tmp_path / "painted.step").write_text(named(str(made), DIRECTIONS))
    assert {face.name for face in tc.faces_in(tmp_path / "painted.step")} == {""}
