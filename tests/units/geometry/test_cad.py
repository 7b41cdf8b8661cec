"""Insides of `geometry` under the claims of `tests/test_cad.py`."""

import logging
import re

import numpy as np
import pytest
import trimesh
from scipy.optimize import approx_fprime

import tolcontact as tc
from tests import cases
from tests.helpers import call
from tests.shapes import shape
from tests.step_files import assembly
from tests.test_cad import COVER
from tolcontact.errors import GeometryFault
from tolcontact.geometry.analytic_surfaces import Cone, Cylinder, Plane, Sphere, Torus
from tolcontact.geometry.files import BREP, STATED_FACES, ReadingLimits, read_files
from tolcontact.geometry.files.product import rigid_motion
from tolcontact.geometry.files.reading import usual_chord
from tolcontact.geometry.files.step_shapes import credible, onto
from tolcontact.geometry.files.step_text import StepText
from tolcontact.geometry.fitting import fit_surface

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


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "stack.step"
    path.write_text(assembly(("pin", (0, 0, 0)), ("set", (100, 0, 0)), ("pin", (0, 0, 5))))
    return path


@pytest.mark.slow
def test_a_file_that_would_be_too_fine_is_cut_more_coarsely(caplog):
    whole = len(shape(tc.Mesh(COVER)).faces)
    with caplog.at_level(logging.WARNING):
        coarse = shape(tc.Mesh(COVER), read_files([tc.Mesh(COVER)], ReadingLimits(triangles=whole - 1)))
    assert len(coarse.faces) < whole / 2 and coarse.is_watertight
    assert "triangles within 0.06 mm, since finer ones are too many" in caplog.text
    with pytest.raises(GeometryFault, match="more than the limit of 10"):
        shape(tc.Mesh(COVER), read_files([tc.Mesh(COVER)], ReadingLimits(triangles=10)))


def test_a_body_that_is_scaled_in_its_place_is_refused(tmp_path):
    with pytest.raises(GeometryFault, match="scaled"):
        rigid_motion(tmp_path, np.diag([1.0, 1.0, 1.001, 1.0]), np.eye(3))
    turned = trimesh.transformations.rotation_matrix(0.3, [1, 2, 3], [300.0, 100.0, 200.0])
    turned32 = turned.astype(np.float32).astype(float)
    place = rigid_motion(tmp_path, turned32, np.eye(3))
    assert place[:3, :3] @ place[:3, :3].T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.abs(place[:3, 3]).max() > 1 and place[:3, 3].tolist() == turned32[:3, 3].tolist()  # [mm]


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
        assert ", ".join(StepText(text).units) == units


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
