"""Elastic bodies of tetrahedra against closed forms of beams and plates, and invariances. All are quadratic."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.sparse import linalg as sparse_linalg
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tolcontact.elasticity import flexibility, meshed_body, responses
from tolcontact.elasticity.meshed_body import body_of
from tolcontact.elasticity.tetrahedra import EDGES, Tetrahedra, shape_functions, stiffness_of
from tolcontact.errors import GeometryFault
from tolcontact.geometry.shapes import shape

pytest.importorskip("netgen")
pytest.importorskip("ngsolve")
COVER = Path(__file__).parents[3] / "models" / "cover.step"
L, B, H, E = 400.0, 20.0, 10.0, 210e3
DENSITY, G = 7850.0, 9.81


def box(size, element_size, poisson, density=None, young=E):
    mesh = trimesh.creation.box(bounds=[(0, 0, 0), size])
    return meshed_body(np.array(mesh.vertices), np.array(mesh.faces), young, poisson, density, None, element_size)


@pytest.fixture(scope="module")
def beam():
    return box((L, B, H), 5.0, 0.0, DENSITY)


@pytest.fixture(scope="module")
def sheet():
    return box((200.0, 200.0, 1.0), 5.0, 0.3)


def up(body, points, radius=None):
    return body.spread(np.array(points, dtype=float), np.tile([0, 0, 1.0], (len(points), 1)), radius)


def deflections(span):
    """The middle of a simply supported Timoshenko beam: by 1 N there, and by 1 N/mm along `span`."""
    inertia, shear = B * H**3 / 12, 5 / 6 * B * H * E / 2
    return span**3 / 48 / E / inertia + span / 4 / shear, 5 * span**4 / 384 / E / inertia + span**2 / 8 / shear


def test_a_beam_on_two_supports_bends_as_timoshenko_says(beam):
    """Edges of half the thickness: 2e-4. The pads indent by another 3e-4 at a radius of 1 mm, a tenth of the thickness."""
    loads = up(beam, [(10, 10, 0), (390, 10, 0), (200, 10, 0)], 2.5)
    force = np.array([-0.5, -0.5, 1])
    assert force @ flexibility(beam, loads) @ force == pytest.approx(deflections(380)[0], rel=3e-4)


def test_a_beam_bends_under_its_own_weight(beam):
    """Supports at both ends (0.5 mm inside): 5 q l^4 / 384 E I and shear."""
    at = [(0.5, 10, 0), (399.5, 10, 0), (200, 10, 0)]
    forces = np.column_stack([up(beam, at, 2.5).toarray(), beam.weight(np.array([0, 0, -G]))])
    assert beam.mass == pytest.approx(L * B * H * 1e-9 * DENSITY, rel=1e-12)
    assert forces[2::3, 3].sum() == pytest.approx(-beam.mass * G, rel=1e-12)
    forces[:, 3] += beam.mass * G / 2 * (forces[:, 0] + forces[:, 1])
    sag = np.array([0.5, 0.5, -1]) @ (forces[:, :3].T @ beam.response(forces[:, 3:]))[:, 0]
    assert sag == pytest.approx(deflections(399)[1] * beam.mass * G / L, rel=1e-3)


def test_a_sheet_twists_as_kirchhoff_says(sheet):
    """One corner of four is low by c: it bears 2 D (1 - nu) c / a^2 less. Edges of five times the thickness: 0.6 %."""
    corners = [(0, 0, 0), (200, 0, 0), (200, 200, 0), (0, 200, 0)]
    pattern = np.array([1, -1, 1, -1])
    stiffness = E * 1.0**3 / 12 / (1 - 0.3**2)
    compliance = pattern @ flexibility(sheet, up(sheet, corners)) @ pattern
    assert compliance == pytest.approx(200**2 / 2 / stiffness / (1 - 0.3), rel=7e-3)


@pytest.mark.parametrize(("element_size", "error"), [(5.0, 0.03), (10.0, 0.3)])
def test_a_clamped_plate_shows_how_coarse_elements_may_be(element_size, error):
    """The middle sinks by 0.0056 F a^2 / D. A twist does not show locking; a clamped plate 100 x 100 x 2 does."""
    body = box((100.0, 100.0, 2.0), element_size, 0.3)
    stiffness = stiffness_of(body.pads.mesh, E, 0.3)
    is_rim = (np.abs(body.nodes[:, :2] - 50) > 49.999).any(axis=1)
    free = np.flatnonzero(np.repeat(~is_rim, 3))
    force = up(body, [(50, 50, 0)]).toarray()[free, 0]
    sag = force @ sparse_linalg.spsolve(stiffness.tocsc()[free][:, free], force)
    exact = 0.0056 * 100**2 / (E * 2**3 / 12 / (1 - 0.3**2))
    assert 1 - error < sag / exact < 1 + 0.02  # shear, which Kirchhoff leaves out, adds 1 %


def test_work_is_twice_the_energy_and_the_flexibility_is_symmetric(beam):
    points, forces = np.random.default_rng(3).uniform(-1, 1, (2, 6, 3))
    loads = beam.spread(np.abs(points) * [L, B, 0], forces, 4.0)
    u = beam.response(loads.toarray())
    asymmetric = loads.T @ u
    assert np.abs(asymmetric - asymmetric.T).max() < 1e-12 * np.abs(asymmetric).max()
    stiffness = stiffness_of(beam.pads.mesh, E, 0.0)
    assert np.diag(u.T @ (stiffness @ u)) == pytest.approx(np.diag(asymmetric), rel=1e-9)


def test_flexibility_is_proportional_to_one_by_the_modulus(beam):
    loads = up(beam, [(10, 10, 0), (200, 10, 0), (300, 10, 10)])
    soft = flexibility(beam, loads)
    for factor in (1e3, 1e6):
        stiff = body_of(beam.pads.mesh, factor * E, 0.0)
        assert factor * flexibility(stiff, loads) == pytest.approx(soft, abs=1e-8 * np.abs(soft).max())  # condition


def test_a_body_turned_in_space_has_the_same_flexibility(beam):
    R, t = Rotation.from_rotvec([0.7, -1.9, 0.4]).as_matrix(), np.array([300.0, -50, 1000])
    mesh = beam.pads.mesh
    turned = body_of(Tetrahedra(mesh.nodes @ R.T + t, mesh.elements), E, 0.0)
    points = np.array([(10, 10, 0), (0, 0, 10), (200, 0, 0), (250, 20, 5), (400, 10, 5), (123, 7, 12)], dtype=float)
    forces = np.random.default_rng(5).normal(size=points.shape)
    C = flexibility(beam, beam.spread(points, forces, 6.0))
    assert flexibility(turned, turned.spread(points @ R.T + t, forces @ R.T, 6.0)) == pytest.approx(
        C, abs=1e-9 * np.abs(C).max()
    )


@pytest.mark.parametrize("radius", [0.01, 2.0, 15.0, None])
@pytest.mark.parametrize("point", [(200, 10, 0), (0, 0, 0), (77, 20, 5), (3, 10, -4), (200, 10, 5)])
def test_a_pad_keeps_resultant_and_moment(beam, point, radius):
    forces = beam.spread(np.tile(np.array(point, dtype=float), (3, 1)), np.diag([1.0, 2.0, 3.0]), radius).toarray()
    by_node = forces.reshape(-1, 3, 3)
    assert by_node.sum(axis=0) == pytest.approx(np.diag([1.0, 2.0, 3.0]), abs=1e-10)
    moments = np.cross(beam.nodes - point, by_node.transpose(2, 0, 1)).sum(axis=1)
    assert np.abs(moments).max() < 1e-8


def test_pads_stay_on_their_face_of_a_sheet(sheet):
    forces = up(sheet, [(100, 100, 1)], 6.0).toarray().reshape(-1, 3)
    loaded = np.abs(forces).max(axis=1) > 0
    assert np.ptp(sheet.nodes[loaded, 2]) < 1e-9
    assert sheet.pads.usual_radius == pytest.approx(200 * 200 / (2 * 200 * 200 + 4 * 200) * 2, rel=1e-6)


@pytest.mark.parametrize("height", [0.0, 0.01, 0.09, 0.11, 0.3, -0.01, -0.3])
def test_a_point_a_little_off_the_surface_acts_nearly_as_one_on_it(sheet, height):
    """Points of faces with form or drawn inaccurately: above and below, the pad stays on its face."""
    forces = up(sheet, [(100, 100, 1), (100, 100, 1 + height), (0, 0, 0), (200, 200, 0), (0, 200, 1)], 2.0)
    C = flexibility(sheet, forces)
    assert C[1] == pytest.approx(C[0], abs=0.02 * np.abs(C[0]).max())
    assert np.abs(sheet.nodes[np.unique(forces[:, [1]].indices // 3), 2] - 1).max() < 1e-9


def test_a_force_on_the_axis_of_a_hole_acts_on_its_wall():
    ring = trimesh.creation.annulus(10, 25, 8)
    body = meshed_body(np.array(ring.vertices), np.array(ring.faces), E, 0.3)
    forces = body.spread(np.array([[0.0, 0, 0]]), np.array([[1.0, 0, 0]]), 3.0).toarray().reshape(-1, 3)
    loaded = np.abs(forces).max(axis=1) > 1e-12
    assert np.hypot(*body.nodes[loaded, :2].T) == pytest.approx(10, rel=1e-2)
    assert np.ptp(np.arctan2(body.nodes[loaded, 1], body.nodes[loaded, 0])) > 6  # all around
    assert forces.sum(axis=0) == pytest.approx([1, 0, 0], abs=1e-12)


def test_a_hollow_body_is_meshed_with_its_cavity():
    outer, inner = trimesh.creation.icosphere(2, 20), trimesh.creation.icosphere(2, 12)
    inner.invert()
    hollow = trimesh.util.concatenate([outer, inner])
    body = meshed_body(np.array(hollow.vertices), np.array(hollow.faces), E, 0.3, 1000.0)
    assert body.mass == pytest.approx(hollow.volume * 1e-6, rel=1e-3)


def test_a_body_from_its_step_file_has_true_round_faces():
    """The cover of the models: the CAD kernel's triangles, within 2 um, have its volume; STL gives the same flexibility."""
    surface = shape(tc.Mesh(COVER))
    part = np.array(surface.vertices), np.array(surface.faces)
    bodies = [meshed_body(*part, 70e3, 0.33, 2700, path, 6.0) for path in (COVER, None)]
    assert len(bodies[0].nodes) != len(bodies[1].nodes)
    points = np.array([(20, 20, 0), (100, 20, 0), (60, 60, 0), (60, 5, 0), (60, 75, 0)], dtype=float)
    balanced = np.linalg.svd(np.column_stack([np.ones(5), points[:, :2]]).T)[2][3:].T
    flexibilities = [balanced.T @ flexibility(body, up(body, points, 4.0)) @ balanced for body in bodies]
    for body in bodies:
        assert body.mass == pytest.approx(surface.volume * 2.7e-6, rel=1e-4)
    assert flexibilities[0] == pytest.approx(flexibilities[1], rel=0.02)


def test_a_bent_surface_is_the_line_of_a_beam_between_nodes_too(beam):
    """Half the deflection over a quarter of the span: 11/16 of the middle's by bending, half by shear."""
    loads = up(beam, [(10, 10, 0), (390, 10, 0), (200, 10, 0)], 2.5)
    places = np.array([(x, 10.3, H) for x in (10.0, 105.2, 200.4, 390.0)])
    _, surface = responses(beam, loads, places)
    ends, quarter, middle = (surface[k, 2] @ [-0.5, -0.5, 1] for k in ([0, 3], 1, 2))
    bending, shear = 380**3 / 48 / E / (B * H**3 / 12), 380 / 4 / (5 / 6 * B * H * E / 2)
    assert middle - ends.mean() == pytest.approx(bending + shear, rel=5e-3)
    assert quarter - ends.mean() == pytest.approx(11 / 16 * bending + shear / 2, rel=1e-2)


def test_a_flexibility_is_computed_once_for_equal_bodies_and_loads(beam):
    """Loads of other values are others: what is kept belongs to the content."""
    loads = up(beam, [(10, 10, 0), (200, 10, 0)])
    C = flexibility(beam, loads)

    def refuse(forces):
        raise AssertionError("it is computed again")

    again = dataclasses.replace(beam, balanced=refuse)
    assert np.array_equal(flexibility(again, loads.copy()), C)
    with pytest.raises(AssertionError, match="again"):
        flexibility(again, 2 * loads)
    with pytest.raises(AssertionError, match="again"):
        flexibility(dataclasses.replace(again, key="another"), loads)


def test_shape_functions_interpolate_and_edges_of_meshes_are_in_order(beam):
    mesh = beam.pads.mesh
    for k, (i, j) in enumerate(EDGES, start=4):
        middle = (mesh.nodes[mesh.elements[:, i]] + mesh.nodes[mesh.elements[:, j]]) / 2
        assert mesh.nodes[mesh.elements[:, k]] == pytest.approx(middle, abs=1e-9)
    for k, (i, j) in enumerate(((1, 2), (0, 2), (0, 1)), start=3):
        middle = (mesh.nodes[mesh.triangles[:, i]] + mesh.nodes[mesh.triangles[:, j]]) / 2
        assert mesh.nodes[mesh.triangles[:, k]] == pytest.approx(middle, abs=1e-9)
    boundary = trimesh.Trimesh(mesh.nodes, mesh.triangles[:, :3], process=False)
    assert boundary.is_watertight
    assert boundary.volume == pytest.approx(L * B * H)  # outward
    at = np.random.default_rng(6).dirichlet([1, 1, 1, 1], 5)
    corners = np.eye(4)
    nodes = np.vstack([corners, *((corners[[i]] + corners[[j]]) / 2 for i, j in EDGES)])
    assert shape_functions(at) @ (nodes[:, 0] * nodes[:, 1]) == pytest.approx(at[:, 0] * at[:, 1], abs=1e-14)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"young": -1.0}, "E is -1.0; expected Young's modulus"),
        ({"poisson": 0.5}, "nu is 0.5; expected Poisson's ratio"),
        ({"density": 0.0}, "density is 0.0; expected kg/m3"),
        ({"element_size": 6.0}, "element_size is 6 mm, and walls are 1 mm thick.*give at most 5 mm"),
        ({"element_size": 1.0}, "more than 60000 nodes.*give at least 3.0"),
        ({"size": (2000.0, 1000.0, 1.0)}, "walls are 1 mm thick, too thin for its.*import a stiffness matrix of shells"),
        ({"pieces": 2}, "consists of 2 pieces"),
        ({"open": True}, "surface is not closed: 3 edges"),
    ],
)
def test_what_cannot_be_meshed_is_refused(change, message):
    change = dict(change)
    mesh = trimesh.creation.box(bounds=[(0, 0, 0), change.pop("size", (200.0, 200.0, 1.0))])
    if change.pop("pieces", 1) == 2:
        mesh = trimesh.util.concatenate([trimesh.creation.box((9, 9, 9)), trimesh.creation.icosphere(1, 2)])
        mesh.vertices[8:] += [20, 0, 0]
    faces = np.array(mesh.faces)[1:] if change.pop("open", False) else np.array(mesh.faces)
    with pytest.raises(GeometryFault, match=message):
        meshed_body(np.array(mesh.vertices), faces, **{"young": E, "poisson": 0.3, **change})


def test_without_the_extra_one_message_names_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "ngsolve", None)
    with pytest.raises(GeometryFault, match=r"netgen-mesher and ngsolve.*tolcontact\[elastic\]"):
        box((10.0, 10.0, 10.0), 5.0, 0.3)
