"""Assemblies from STEP files, and faces that know their surfaces."""

import itertools
import json
import re

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tests.helpers import ROOT, call, compiled
from tests.shapes import shape
from tests.step_files import assembly, step_block
from tolcontact.discretization import discretize
from tolcontact.errors import GeometryFault

COVER = cases.MODELS / "cover.step"


def test_the_faces_of_a_part_say_what_they_are():
    found = tc.io.faces_in(COVER)
    assert [face.number for face in found] == list(range(1, 16))
    holes = [face for face in found if face.kind == "cylinder" and face.is_inner]
    assert [face.radius for face in holes] == pytest.approx([4.05] * 3, abs=1e-12)
    assert found[1].direction == pytest.approx((0, 0, 1)) and found[4].direction == pytest.approx((0, 0, -1))
    assert all(face.residual == 0 for face in found)


def triangles(*criteria):
    model = tc.Assembly("one")
    cover = model.part("cover", tc.Mesh(COVER), fixed=True)
    model.measure("corner", cover.point(0, 0, 0), along="z")
    return discretize(model).triangles(cover.face(*criteria))


def test_faces_are_chosen_by_number_kind_and_size():
    assert triangles(tc.select.Brep(2)) == triangles(tc.select.Largest("plane", "+z")) == triangles(tc.select.Brep((60, 10, 8)))
    holes = sorted(triangles(tc.select.Brep(11)) + triangles(tc.select.Brep(13)) + triangles(tc.select.Brep(15)))
    assert triangles(tc.select.Cylinder(radius=4.05)) == triangles(tc.select.Cylinder(inner=True)) == holes
    corners = sorted(itertools.chain(*(triangles(tc.select.Brep(number)) for number in (3, 4, 8, 9))))
    assert triangles(tc.select.Cylinder(radius=6)) == triangles(tc.select.Cylinder(inner=False)) == corners
    for wrong in (tc.select.Brep(16), tc.select.Brep(0), tc.select.Cylinder(radius=4.06), tc.select.Largest("sphere")):
        with pytest.raises(GeometryFault, match=r"face cover .*(faces 1 to 15|no such face)"):
            triangles(wrong)
    assert "expected one of: plane" in next(tc.select.Largest("round").faults())


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "stack.step"
    path.write_text(assembly(("pin", (0, 0, 0)), ("set", (100, 0, 0)), ("pin", (0, 0, 5))))
    return path


def test_bodies_of_an_assembly_have_names_places_and_sizes(file):
    found = tc.io.bodies_in(file)
    assert [body.name for body in found] == ["use 0", "use 1", "use 1 (2)", "use 1 (3)", "use 2"]
    assert [body.number for body in found] == [1, 2, 3, 4, 5] and found[0].path == ("whole", "use 0")
    assert (
        found[4].at == (0, 0, 5) and found[4].lower == pytest.approx((0, 0, 5)) and found[4].upper == pytest.approx((5, 5, 10))
    )
    assert found[2].lower == pytest.approx((110, 0, 0)) and found[3].faces == 12  # with its cavity
    own = shape(tc.Mesh(file, body="use 2"))
    assert own.bounds == pytest.approx(np.array([[0, 0, 0], [5, 5, 5]]))  # in the frame of its product
    assert shape(tc.Mesh(file, body=5)).vertices == pytest.approx(own.vertices)


@pytest.mark.slow
def test_an_assembly_is_declared_from_its_file_alone(file):
    model = tc.Assembly("stack")
    parts = tc.io.parts_from(model, file, ["use 0", "use 2"])
    assert list(parts) == ["use 0", "use 2"] == [part.name for part in model.parts]
    upper, lower = parts["use 2"], parts["use 0"]
    scheme = tc.three_two_one(upper.face(tc.select.Largest("plane", "-z")), upper.face("-y"), upper.face("-x"), inset=0.5)
    model.locate(upper, scheme, tolerance=0.2)
    model.locate(lower, tc.three_two_one(lower.face("-z"), lower.face("-y"), lower.face("-x"), inset=0.5), tolerance=0.1)
    model.contact("seat", moving=upper.face("-z"), reference=lower.face("+z"))
    model.measure("gap", lower.point(2.5, 2.5, 5), to=upper.point(2.5, 2.5, 0), along="z", tolerance=0.3)
    results = tc.run(compiled(model, solver="daqp"), samples=300, seed=1, surfaces=16)
    assert (results["status"] <= 1).all()
    raw, corrected = (results["measured"].sel(state=state, measure="gap") for state in ("raw", "corrected"))
    assert float(raw.min()) < -0.05 and float(corrected.min()) > -0.005  # points beside each other, faces tilted
    again = tc.run(compiled(tc.io.model_of(results), solver="daqp"), samples=300, seed=1, surfaces=0)
    assert np.array_equal(again["measured"].values, results["measured"].values)
    assert len(tc.io.parts_from(tc.Assembly("all"), file)) == 5


@pytest.mark.slow
def test_what_a_file_does_not_hold_is_told(file, tmp_path):
    with pytest.raises(tc.ModelError, match=r'holds no body "use 9"; it holds "use 0", "use 1"'):
        tc.io.parts_from(tc.Assembly("stack"), file, ["use 9"])
    with pytest.raises(tc.ModelError, match="does not exist"):
        tc.io.parts_from(tc.Assembly("stack"), tmp_path / "none.step")
    (tmp_path / "ball.stl").write_bytes(trimesh.creation.icosphere(1).export(file_type="stl"))
    with pytest.raises(tc.OptionError, match="not a STEP file"):
        tc.io.bodies_in(tmp_path / "ball.stl")
    with pytest.raises(tc.OptionError, match="holds 5 bodies, but a part is one body; name one"):
        tc.io.faces_in(file)
    model = tc.Assembly("ball")
    model.part("ball", tc.Mesh(tmp_path / "ball.stl", body="ball"), fixed=True)
    with pytest.raises(tc.ModelError, match="only STEP files hold bodies"):
        tc.build(model)
    for chord, source, said in (
        (0.1, tmp_path / "ball.stl", "only STEP files are triangulated"),
        (0, file, "chord is 0; expected"),
    ):
        model = tc.Assembly("ball")
        model.part("ball", tc.Mesh(source, chord=chord), fixed=True)
        with pytest.raises(tc.ModelError, match=said):
            tc.build(model)


def test_a_place_that_has_only_the_kernels_label_is_called_after_its_product(tmp_path):
    """The kernel's writer states its own labels as names."""
    path = tmp_path / "labels.step"
    path.write_text(assembly(("pin", (0, 0, 0)), ("pin", (9, 0, 0))).replace("use 0", "=>[0:1:1:2]"))
    assert [(body.name, body.path) for body in tc.io.bodies_in(path)] == [
        ("pin", ("whole", "pin")),
        ("use 1", ("whole", "use 1")),
    ]


def test_names_that_no_part_may_have_are_changed(tmp_path):
    path = tmp_path / "odd.step"
    path.write_text(assembly(("pin", (0, 0, 0)), ("pin", (9, 0, 0))).replace("use 0", "M6/12").replace("use 1", "-x ?"))
    model = tc.Assembly("odd")
    parts = tc.io.parts_from(model, path)
    assert list(parts) == ["M6_12", "body 2 -x ?"]
    assert not [fault for fault in model.faults() if "name must" in fault]


def test_the_command_line_lists_bodies_and_faces(file):
    listed = call(file.parent, "bodies", file)
    assert listed.stdout.splitlines()[:2] == [
        "lengths in the file: millimetre; here: mm, along x, y, z of the assembly",
        "whole",
    ]
    bodies = json.loads(call(file.parent, "bodies", file, "--json").stdout)
    assert [body["name"] for body in bodies][-1] == "use 2" and bodies[-1]["at"] == [0, 0, 5]
    listed = call(file.parent, "faces", file, "--body", "use 2").stdout
    assert len(listed.splitlines()) == 6 and "1. plane, along (0, 0, -1), 25 mm2" in listed
    faces = json.loads(call(file.parent, "faces", file, "--body", "5", "--json").stdout)
    assert sum(face["area"] for face in faces) == pytest.approx(150)


def test_some_bodies_of_a_file_are_fixed(file):
    """A list of names fixes these; True or False applies to all."""
    model = tc.Assembly("stack")
    parts = tc.io.parts_from(model, file, fixed=["use 0"])
    assert {name for name, part in parts.items() if part.fixed} == {"use 0"}
    assert {part.fixed for name, part in parts.items() if name != "use 0"} == {None}
    for fixed in (True, False, None):
        assert {part.fixed for part in tc.io.parts_from(tc.Assembly("a"), file, fixed=fixed).values()} == {fixed}
    assert {part.fixed for part in tc.io.parts_from(tc.Assembly("a"), file, fixed=[]).values()} == {None}
    with pytest.raises(tc.ModelError, match='holds no body "plate"; it holds'):
        tc.io.parts_from(tc.Assembly("a"), file, fixed=["plate"])
    with pytest.raises(tc.ModelError, match='fixed has the body "use 0", which is not in names; add it there'):
        tc.io.parts_from(tc.Assembly("a"), file, ["use 1"], fixed=["use 0"])
    for wrong in ("use 0", 3, {"use 0": True}, [1]):
        with pytest.raises(TypeError, match="expected a list of the names of bodies, as in fixed="):
            tc.io.parts_from(tc.Assembly("a"), file, fixed=wrong)
    with pytest.raises(TypeError, match=r'names is \'use 0\'; expected a list .* as in names=\["use 0"\]'):
        tc.io.parts_from(tc.Assembly("a"), file, "use 0")


def test_check_and_bodies_state_sizes_along_the_same_axes(tmp_path):
    """Nuts of as1 lie on their sides: 20 x 15 x 3 mm in the frame of their product, 3 x 15 x 20 mm in the assembly."""
    source = ROOT / "studies" / "cad" / "as1-oc-214.stp"
    model = tmp_path / "model.py"
    model.write_text(
        "import tolcontact as tc\n\ndef assembly():\n    model = tc.Assembly('as1')\n"
        f"    parts = tc.io.parts_from(model, {str(source)!r}, fixed=True)\n"
        "    model.measure('x', parts['nut_1'].point(0, 0, 0), along='x')\n    return model\n"
    )
    listed = call(tmp_path, "bodies", source).stdout
    checked = call(tmp_path, "check", model).stdout
    sizes = dict(re.findall(r"\d+\. (.*): (.*) mm, \d+ faces", listed))
    assert sizes["nut_1"] == "3 x 15 x 20" and len(sizes) == 18
    assert dict(re.findall(r"  part (.*): (.*) mm along x, y, z of the assembly, \d+ triangles", checked)) == sizes


def test_a_wrong_body_has_a_message_that_lists_the_bodies(file, tmp_path):
    for options, message in (
        (["--body", "use 9"], "holds no body 'use 9'; it holds 5: 1. "),
        (["--body", "99"], "holds no body 99; it holds 5: 1. "),
        ([], '--body "..."'),
    ):
        finished = call(file.parent, "faces", file, *options)
        assert finished.returncode == 2
        assert message in finished.stderr and '"use 2"' in finished.stderr


@pytest.mark.slow
def test_one_body_alone_stands_where_its_file_puts_it(tmp_path):
    (tmp_path / "one.step").write_text(assembly(("pin", (7, 0, 0))))
    assert shape(tc.Mesh(tmp_path / "one.step")).bounds == pytest.approx(np.array([[7, 0, 0], [12, 5, 5]]))
    assert shape(tc.Mesh(tmp_path / "one.step", body=1)).bounds == pytest.approx(np.array([[0, 0, 0], [5, 5, 5]]))
    (tmp_path / "block.step").write_text(step_block())
    assert tc.io.bodies_in(tmp_path / "block.step")[0].at == (0, 0, 0)


@pytest.mark.slow
def test_a_file_is_read_again_once_it_has_changed(tmp_path, monkeypatch):
    path = tmp_path / "part.step"
    path.write_text(step_block())
    before = tc.io.bodies_in(path)[0].upper
    monkeypatch.setattr("subprocess.Popen", None)
    assert tc.io.bodies_in(path)[0].upper == before  # from memory
    monkeypatch.undo()
    path.write_text(assembly(("pin", (0, 0, 0)), ("pin", (9, 0, 0))))
    assert len(tc.io.bodies_in(path)) == 2


@pytest.mark.slow
def test_the_largest_round_face_is_along_an_axis_whichever_way_it_points():
    assert (
        triangles(tc.select.Largest("cylinder", "+z"))
        == triangles(tc.select.Largest("cylinder", "-z"))
        == triangles(tc.select.Brep(11))
    )
    with pytest.raises(GeometryFault, match="no such face"):
        triangles(tc.select.Largest("cylinder", "x"))


def test_wrong_bodies_and_names_are_told_and_names_do_not_steer_a_terminal(file):
    for wrong in (True, 1.5):
        assert "expected the name of a body, or its number" in " ".join(tc.Mesh(file, body=wrong).faults())
    with pytest.raises(TypeError, match="expected a list of the names"):
        tc.io.parts_from(tc.Assembly("stack"), file, "use 0")
    file.write_text(file.read_text().replace("use 0", "\x1b[31m red"))
    listed = call(file.parent, "bodies", file).stdout
    assert "red" in listed and "\x1b" not in listed
    assert "\x1b" not in "".join(tc.io.parts_from(tc.Assembly("stack"), file))
    file.write_text(file.read_text().replace("\x1b[31m red", r"two\X\0Alines"))
    assert r"two\nlines" in call(file.parent, "bodies", file).stdout
