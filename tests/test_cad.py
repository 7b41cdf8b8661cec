"""Assemblies from STEP files, and faces that know their surfaces."""

import itertools
import json
import logging
import re

import numpy as np
import pytest
import trimesh
from scipy.optimize import approx_fprime

import tolcontact as tc
from tests import cases
from tests.helpers import ROOT, call
from tests.shapes import shape
from tests.step_files import assembly, step_block
from tolcontact.discretization import discretize
from tolcontact.errors import GeometryFault
from tolcontact.geometry.analytic_surfaces import Cone, Cylinder, Plane, Sphere, Torus
from tolcontact.geometry.files import BREP, STATED_FACES, ReadingLimits, read_files
from tolcontact.geometry.files.product import rigid_motion
from tolcontact.geometry.files.reading import usual_chord
from tolcontact.geometry.files.step_shapes import credible, onto
from tolcontact.geometry.files.step_text import StepText
from tolcontact.geometry.fitting import fit_surface

COVER = cases.MODELS / "cover.step"
TILTED = np.array([1.0, 2.0, 2.0]) / 3
ANALYTIC = [
    Plane(np.array([1.0, 2, 3]), TILTED),
    Cylinder(np.array([1.0, 2, 3]), TILTED, radius=5),
    Cone(np.array([1.0, 2, 3]), TILTED, angle=0.4),
    Sphere(np.array([1.0, 2, 3]), TILTED, radius=5),
    Torus(np.array([1.0, 2, 3]), TILTED, radius=5, minor=2),
]
POINTS = np.random.default_rng(1).normal(scale=10, size=(50, 3))


@pytest.mark.parametrize("surface", ANALYTIC, ids=lambda surface: surface.kind)
def test_distances_have_unit_gradients_and_end_on_the_surface(surface):
    value, slope = surface.distance(POINTS)
    numeric = [approx_fprime(p, lambda q: surface.distance(q[None])[0][0], 1e-6) for p in POINTS]
    assert np.abs(slope - numeric).max() < 1e-4
    assert np.linalg.norm(slope, axis=1) == pytest.approx(1)
    foot = surface.project(POINTS)
    assert np.abs(surface.distance(foot)[0]).max() < 1e-12
    assert np.linalg.norm(foot - POINTS, axis=1) == pytest.approx(np.abs(value), abs=1e-9)


@pytest.mark.parametrize("surface", ANALYTIC, ids=lambda surface: surface.kind)
def test_a_surface_moves_with_its_part(surface):
    R, t = trimesh.transformations.random_rotation_matrix(np.array([0.1, 0.5, 0.9]))[:3, :3], np.array([3.0, -1, 2])
    assert surface.placed(R, t).distance(POINTS @ R.T + t)[0] == pytest.approx(surface.distance(POINTS)[0], abs=1e-12)


def test_vertices_are_put_back_where_surfaces_meet():
    """The corner of three planes, an edge of a plane and a cylinder; what is too far off stays."""
    x, y, z = (Plane(np.zeros(3), axis) for axis in np.eye(3))
    round_ = Cylinder(np.zeros(3), np.array([0.0, 0, 1]), radius=2.0)
    vertices = np.array([[1e-6, -2e-6, 3e-6], [2 + 1e-6, 0.0, 2e-6], [5.0, 5.0, 1e-6], [9.0, 9.0, 0.5]])
    faces, brep = np.array([[0, 0, 0], [0, 0, 0], [0, 1, 2], [1, 1, 1], [3, 3, 3]]), np.array([0, 1, 2, 3, 2])
    found = onto(vertices, faces, brep, [x, y, z, round_], 1e-3)
    assert found == pytest.approx(np.array([[0, 0, 0], [2, 0, 0], [5, 5, 0], [9, 9, 0.5]]), abs=1e-12)
    assert credible(found, faces, brep, [x, y, z, round_], 1e-3) == [x, y, None, round_]


def test_surfaces_are_fitted_where_a_file_states_none():
    rng = np.random.default_rng(2)
    for radius, mesh in (
        (7.5, trimesh.creation.cylinder(7.5, 20, sections=60)),
        (3.0, trimesh.creation.icosphere(3, radius=3.0)),
    ):
        R = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
        side = np.abs(mesh.face_normals[:, 2]) < 0.5 if radius == 7.5 else np.ones(len(mesh.faces), dtype=bool)
        used = np.unique(mesh.faces[side])
        vertices = mesh.vertices[used] @ R.T + [10.0, 20.0, -5.0] + rng.normal(scale=1e-6, size=(len(used), 3))
        moved = np.zeros((len(mesh.vertices), 3))
        moved[used] = vertices
        surface = fit_surface(moved[mesh.faces[side]], 1e-4)
        assert surface.kind == ("cylinder" if radius == 7.5 else "sphere")
        assert surface.radius == pytest.approx(radius, abs=2e-6) and 0 < surface.residual < 1e-5
    box = trimesh.creation.box()
    assert fit_surface(box.triangles, 1e-4) is not None  # eight corners lie on a sphere; sharp turns do not matter
    assert fit_surface(rng.normal(size=(30, 3, 3)), 1e-4) is None
    # Two rings of vertices lie on a sphere, too; and a large face that is none of these is told from few of its triangles.
    profile = np.array([[4, 0], [9, 3], [12, 3], [12, 0], [4, 0]], dtype=float)
    funnel = trimesh.creation.revolve(profile, sections=90)
    slope = (np.abs(funnel.face_normals[:, 2]) > 0.1) & (np.abs(funnel.face_normals[:, 2]) < 0.99)
    surface = fit_surface(funnel.triangles[slope], 1e-6)
    assert surface.kind == "cone" and surface.angle == pytest.approx(np.arctan(5 / 3), abs=1e-9)
    egg = trimesh.creation.icosphere(5, radius=10).apply_scale([1.001, 1, 1])
    assert len(egg.faces) > 10_000 and fit_surface(egg.triangles, 1e-3) is None


def test_vertices_of_a_step_file_lie_on_its_surfaces_in_double_precision():
    mesh = shape(tc.Mesh(COVER))
    brep = np.asarray(mesh.face_attributes[BREP])
    for number, face in enumerate(mesh.metadata[STATED_FACES]):
        own = mesh.vertices[np.unique(mesh.faces[brep == number])]
        assert np.abs(face.surface.distance(own)[0]).max() < 1e-11
    assert mesh.is_watertight


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
    results = tc.run(model, samples=300, seed=1, solver="daqp", surfaces=16)
    assert (results["status"] <= 1).all()
    raw, corrected = (results["measured"].sel(state=state, measure="gap") for state in ("raw", "corrected"))
    assert float(raw.min()) < -0.05 and float(corrected.min()) > -0.005  # points beside each other, faces tilted
    again = tc.run(tc.io.model_of(results), samples=300, seed=1, solver="daqp", surfaces=0)
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
def test_a_file_that_would_be_too_fine_is_cut_more_coarsely(caplog):
    whole = len(shape(tc.Mesh(COVER)).faces)
    with caplog.at_level(logging.WARNING):
        coarse = shape(tc.Mesh(COVER), read_files([tc.Mesh(COVER)], ReadingLimits(triangles=whole - 1)))
    assert len(coarse.faces) < whole / 2 and coarse.is_watertight
    assert "triangles within 0.06 mm, since finer ones are too many" in caplog.text
    with pytest.raises(GeometryFault, match="more than the limit of 10"):
        shape(tc.Mesh(COVER), read_files([tc.Mesh(COVER)], ReadingLimits(triangles=10)))


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


def test_a_body_that_is_mirrored_in_its_place_is_refused(tmp_path):
    with pytest.raises(GeometryFault, match="mirrored or scaled"):
        rigid_motion(tmp_path, np.diag([1.0, 1.0, -1.0, 1.0]))
    with pytest.raises(GeometryFault, match="mirrored or scaled"):
        rigid_motion(tmp_path, np.diag([1.0, 1.0, 1.001, 1.0]))
    turned = trimesh.transformations.rotation_matrix(0.3, [1, 2, 3], [300.0, 100.0, 200.0])
    turned32 = turned.astype(np.float32).astype(float)
    place = rigid_motion(tmp_path, turned32)
    assert place[:3, :3] @ place[:3, :3].T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.abs(place[:3, 3]).max() > 1 and place[:3, 3].tolist() == turned32[:3, 3].tolist()  # [mm]


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


def test_the_units_of_a_file_are_stated(file):
    assert all(body.units == "millimetre" for body in tc.io.bodies_in(file))
    listed = call(file.parent, "bodies", file).stdout
    assert listed.startswith("lengths in the file: millimetre; here: mm, along x, y, z of the assembly\n")
    si = b"#1=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(%s,.METRE.));\n"
    inch = b"#2=( CONVERSION_BASED_UNIT('INCH',#3) LENGTH_UNIT() NAMED_UNIT(#4) );\n"
    for text, units in (
        (si % b".MILLI.", "millimetre"),
        (si % b"$", "metre"),
        (si % b".MILLI." + inch, "inch"),
        (b"#1=X();", ""),
    ):
        assert StepText(text).units == units


@pytest.mark.parametrize("name", ["cover", "housing"])
def test_surfaces_have_the_numbers_of_the_file(name):
    """Planes within 1e-9 mm, radii within 1e-12 mm of what the text says."""
    path = cases.MODELS / f"{name}.step"
    text = re.sub(r"\s+", "", path.read_text())
    points, directions = (
        {
            key: np.array(numbers.split(","), dtype=float)
            for key, numbers in re.findall(rf"#(\d+)={entity}\('[^']*',\(([^)]*)\)\)", text)
        }
        for entity in ("CARTESIAN_POINT", "DIRECTION")
    )
    axes = {key: rest for key, *rest in re.findall(r"#(\d+)=AXIS2_PLACEMENT_3D\('[^']*',#(\d+),#(\d+)", text)}
    placed = [axes[key] for key in re.findall(r"=PLANE\('[^']*',#(\d+)\)", text)]
    planes = np.array([[*directions[n], points[p] @ directions[n]] for p, n in placed])
    radii = np.array(re.findall(r"=CYLINDRICAL_SURFACE\('[^']*',#\d+,([^)]*)\)", text), dtype=float)
    surfaces = [face.surface for face in shape(tc.Mesh(path)).metadata[STATED_FACES]]
    assert {surface.kind for surface in surfaces} == ({"plane", "cylinder"} if len(radii) else {"plane"})
    for surface in surfaces:
        if surface.kind == "cylinder":
            assert np.abs(radii - surface.radius).min() < 1e-12
        else:
            own = np.array([*surface.axis, surface.axis @ surface.origin])
            assert min(np.abs(planes - sign * own).max(axis=1).min() for sign in (1, -1)) < 1e-9


@pytest.mark.parametrize(
    ("unit", "points", "chord"),
    [
        ("SI_UNIT(.MILLI.,.METRE.)", [(0, 0, 0), (100, 50, 10)], 0.002),
        ("SI_UNIT(.MILLI.,.METRE.)", [(0, 0, 0), (-4.0e3, 50, 10.0)], 0.02),
        ("SI_UNIT($,.METRE.)", [(0, 0, 0), (4, 1, 1)], 0.02),
        ("CONVERSION_BASED_UNIT('INCH',#9)", [(0, 0, 0), (1, 200, 1)], 0.0254),
        ("SI_UNIT(.MILLI.,.METRE.)", [], 0.002),
        ("SI_UNIT(.MILLI.,.METRE.)", [("1e", 0, 0), (100, 50, 10)], 0.002),
    ],
)
def test_triangles_are_as_fine_as_the_extent_of_a_file_asks(unit, points, chord):
    records = [f"#{k}=CARTESIAN_POINT( 'P{k}',({','.join(map(str, at))}));" for k, at in enumerate(points * 60)]
    records.append(f"#5001=(LENGTH_UNIT(){unit});")
    text = StepText("\n".join(["ISO-10303-21;", *records]).encode())
    assert usual_chord(text) == pytest.approx(chord)
