"""Shapes from files, their units, and the faces that are picked from them."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tests.helpers import ALL_POINTS, simulate
from tolcontact.discretization import discretize
from tolcontact.discretization.faces import patch
from tolcontact.discretization.fault import GeometryFault
from tolcontact.discretization.shape_files.reading import MAX_TRIANGLES, STEP_CHORD
from tolcontact.discretization.shapes import shape
from tolcontact.errors import UnitsWarning
from tolcontact.statistics import intervals
from tolcontact.vocabulary import CORRECTED

HOUSING = Path(__file__).resolve().parents[1] / "models" / "housing.step"
BLOCK = trimesh.creation.box(bounds=[[0, 0, 0], [10, 20, 30]])


def face_of(mesh, *selections):
    part = tc.Assembly("faces").part("part", tc.Mesh(mesh))
    return patch(part.face(*selections), {part: shape(part.geometry).mesh})


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "glb"])
def test_meshes_are_read_in_the_units_of_their_kind(suffix, tmp_path):
    path = tmp_path / f"block.{suffix}"
    BLOCK.copy().apply_scale(1e-3 if suffix == "glb" else 1).export(path)
    mesh = shape(tc.Mesh(path)).mesh
    assert mesh.extents == pytest.approx([10, 20, 30], rel=1e-6)
    assert mesh.is_watertight and len(mesh.vertices) == 8
    assert shape(tc.Mesh(path, units="in")).mesh.extents[0] == pytest.approx(254 if suffix != "glb" else 0.254, rel=1e-6)


def test_a_trimesh_is_taken_in_its_own_units_and_stays_as_it_was():
    own = BLOCK.copy()
    own.units = "inches"
    assert shape(tc.Mesh(own)).mesh.extents == pytest.approx([254, 508, 762])
    assert shape(tc.Mesh(own, units="mm")).mesh.extents == pytest.approx([10, 20, 30])
    assert own.extents == pytest.approx([10, 20, 30])
    own.units = "furlong"
    with pytest.raises(GeometryFault, match="furlong"):
        shape(tc.Mesh(own))


def test_step_comes_in_mm_with_flat_faces_where_they_were_drawn():
    mesh = shape(tc.Mesh(HOUSING)).mesh
    assert mesh.is_watertight
    assert mesh.bounds.tolist() == [[0, 0, 0], [120, 80, 40]]
    top = mesh.triangles[mesh.face_normals[:, 2] > 0.999]
    assert set(np.unique(top[:, :, 2])) == {10.0, 28.0, 40.0}  # cavity, bottoms of the holes, rim


def test_a_brep_face_is_found_by_a_point_on_it():
    hole = face_of(HOUSING, tc.Brep((19, 15, 35)))  # radius 4 about (15, 15), 12 deep
    points, _ = trimesh.sample.sample_surface(hole.mesh, 500, seed=1)
    nearest, normals, over = hole.project(points)
    radius = np.linalg.norm(nearest[:, :2] - [15, 15], axis=1)
    assert over.all()
    assert radius.max() < 4 + 1e-5 and radius.min() > 4 - STEP_CHORD
    out_of_the_material = ([15, 15] - nearest[:, :2]) / radius[:, None]
    assert np.abs(normals - np.c_[out_of_the_material, 0 * radius]).max() < 1e-3
    assert hole.mesh.area == pytest.approx(2 * np.pi * 4 * 12, rel=1e-3)


@pytest.mark.parametrize(
    ("at", "words"), [((60, 40, 90), "mm away"), ((19, 15, 40), "where 2 faces meet"), ((60, 0, 0), "where 2 faces meet")]
)
def test_a_brep_face_that_is_not_clear_is_refused(at, words):
    with pytest.raises(GeometryFault, match=words):
        face_of(HOUSING, tc.Brep(at))
    with pytest.raises(GeometryFault, match="no STEP file"):
        face_of(BLOCK, tc.Brep((5, 5, 30)))


def test_criteria_are_met_together():
    assert face_of(BLOCK, "+z").mesh.area == pytest.approx(200)
    assert face_of(BLOCK).mesh.area == pytest.approx(BLOCK.area)
    assert face_of(BLOCK, "+z", tc.Inside((2, 3, 0), (7, 5, 30))).mesh.area == pytest.approx(10)
    assert face_of(BLOCK, tc.Inside((0, 0, 15), (10, 20, 30)), lambda c, n: n[:, 2] < 0.5).mesh.area == pytest.approx(900)
    assert face_of(BLOCK, tc.Facing((1, 1, 0), 0.8)).mesh.area == pytest.approx(200 * 3 / 2 * 3)
    with pytest.raises(GeometryFault, match=r"nothing of it lies there; the part spans \(0, 0, 0\) to \(10, 20, 30\)"):
        face_of(BLOCK, "+z", tc.Inside((0, 0, 0), (10, 20, 29)))
    with pytest.raises(GeometryFault, match="no triangles"):
        face_of(BLOCK, "+z", "-z")


def test_a_cut_face_keeps_the_normals_of_the_whole():
    barrel = trimesh.creation.cylinder(10, 40, sections=48)
    cut = face_of(barrel, lambda c, n: abs(n[:, 2]) < 0.1, tc.Inside((-11, -11, -3), (11, 3, 11)))
    points, _ = trimesh.sample.sample_surface(cut.mesh, 300, seed=1)
    nearest, normals, _ = cut.project(points)
    assert points[:, 2].min() > -3 and points[:, 1].max() < 3
    radial = np.c_[nearest[:, :2], 0 * nearest[:, 0]]
    assert np.abs(normals - radial / np.linalg.norm(radial, axis=1, keepdims=True)).max() < (np.pi / 48) ** 2


def test_the_face_near_another_part_is_the_one_that_looks_at_it():
    a = tc.Assembly("near")
    table = a.part("table", tc.Box(50, 50, 10), at=(0, 0, -10), fixed=True)
    block = a.part("block", tc.Mesh(BLOCK), at=(30, 5, 0.2), rotation=(0, 0, np.pi / 2))
    meshes = {part: shape(part.geometry).mesh for part in (table, block)}
    assert patch(block.face(tc.Near(table, 0.3)), meshes).mesh.area == pytest.approx(200)
    assert patch(table.face(tc.Near(block, 0.3)), meshes).mesh.area == pytest.approx(2500)
    with pytest.raises(GeometryFault, match="no triangles"):
        patch(block.face(tc.Near(table, 0.1)), meshes)


def disc(sections=24):
    """A disc whose triangles touch the rim with one corner only, as those of CAD kernels do: an ear-cut polygon."""
    angle = np.linspace(0, 2 * np.pi, sections, endpoint=False)
    corners = np.c_[20 * np.cos(angle), 20 * np.sin(angle), 0 * angle]
    ring, faces = list(range(sections)), []
    while len(ring) > 2:  # every second corner is cut off, round after round
        for k in range(0, len(ring) - 1, 2):
            faces.append([ring[k], ring[k + 1], ring[(k + 2) % len(ring)]])
        ring = ring[::2]
    return trimesh.Trimesh(corners, faces, process=False)


def test_points_beside_a_rim_do_not_count_whatever_the_triangles_are():
    flat = face_of(disc())
    assert flat.mesh.area == pytest.approx(12 * 400 * np.sin(2 * np.pi / 24))
    points = np.c_[np.random.default_rng(0).uniform(-80, 80, (4000, 2)), np.full(4000, 0.1)]
    _, _, over = flat.project(points)
    inside = np.hypot(*points[:, :2].T) < 20 * np.cos(np.pi / 24)
    assert over[inside].all()
    assert not over[np.hypot(*points[:, :2].T) > 20.001].any()


@pytest.mark.parametrize("at", [(0, 0), (333, 217), (701.3, 487.9)])
def test_a_small_part_is_near_a_large_one_wherever_it_stands(at):
    a = tc.Assembly("pads")
    plate = a.part("plate", tc.Box(1000, 700, 2), fixed=True)
    pad = a.part("pad", tc.Box(4, 4, 2), at=(*at, 2.05))
    meshes = {part: shape(part.geometry).mesh for part in (plate, pad)}
    assert patch(plate.face(tc.Near(pad, 0.1)), meshes).mesh.area == pytest.approx(700_000)
    assert patch(pad.face(tc.Near(plate, 0.1)), meshes).mesh.area == pytest.approx(16)


def test_what_is_near_on_a_large_barrel_is_not_the_whole_barrel():
    a = tc.Assembly("barrel")
    barrel = a.part("barrel", tc.Mesh(trimesh.creation.cylinder(200, 10, sections=700)), fixed=True)
    block = a.part("block", tc.Box(10, 10, 10), at=(200.1, -5, -5))
    meshes = {part: shape(part.geometry).mesh for part in (barrel, block)}
    near = patch(barrel.face(tc.Near(block, 0.5)), meshes).mesh
    assert near.bounds[0, 0] > 199
    assert 100 < near.area < 400


def body(shift=0.0, invert=False, size=1.0):
    made = BLOCK.copy().apply_scale(size).apply_translation((shift, 0, 0))
    if invert:
        made.invert()
    return made


def sheets():
    flat = trimesh.Trimesh([[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]], [[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]])
    return trimesh.util.concatenate([flat, body(20)])


def twisted():
    mesh = body()
    mesh.faces[3] = mesh.faces[3][::-1]
    return mesh


def degenerate():
    mesh = body()
    return trimesh.Trimesh([*mesh.vertices, mesh.vertices[0]], [*mesh.faces, [0, 1, 8], [2, 2, 3]], process=False)


def opened():
    return trimesh.Trimesh(BLOCK.vertices, BLOCK.faces[BLOCK.face_normals[:, 2] < 0.5])


ACCEPTED = {
    "open": opened(),
    "two bodies": body() + body(20),
    "a cavity": body() + body(2.0, invert=True, size=0.5).apply_translation((0, 2, 2)),
    "degenerate triangles": degenerate(),
    "corners not merged": trimesh.Trimesh(BLOCK.triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False),
}
REFUSED = {
    "vertices that are not": (trimesh.Trimesh(np.eye(3), [[0, 1, 5]], process=False), "vertices that it does not have"),
    "inside out beside another": (
        trimesh.boolean.difference(
            [trimesh.creation.box(bounds=[[0] * 3, [30] * 3]), trimesh.creation.box(bounds=[[2, 2, -1], [31] * 3])],
            engine="manifold",
        )
        + body(invert=True, size=0.4).apply_translation((12, 12, 5)),
        "body 2 of 2 is inside out",
    ),
    "inside out": (body(invert=True), "it is inside out"),
    "one body inside out": (body() + body(20, invert=True), "body 2 of 2 is inside out"),
    "neighbours turned against each other": (twisted(), "3 edges two neighbouring triangles"),
    "no triangles": (trimesh.Trimesh(), "no triangles"),
    "no area": (trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], process=False), "no area"),
}


@pytest.mark.parametrize("kind", ACCEPTED)
def test_meshes_with_an_outside_are_accepted(kind):
    own = face_of(ACCEPTED[kind], "-x").mesh
    assert own.area == pytest.approx({"two bodies": 1200, "a cavity": 750}.get(kind, 600))
    assert len(own.vertices) == {"two bodies": 8, "a cavity": 8}.get(kind, 4)


@pytest.mark.parametrize("kind", REFUSED)
def test_meshes_without_an_outside_are_refused(kind):
    mesh, words = REFUSED[kind]
    with pytest.raises(GeometryFault, match=words):
        shape(tc.Mesh(mesh))


def test_coincident_triangles_that_look_opposite_ways_are_refused_where_they_are_chosen():
    assert face_of(sheets(), "+x").mesh.area > 0
    assert face_of(sheets(), "+z", tc.Inside((0, 0, -1), (9, 9, 1))).mesh.area == pytest.approx(81)
    with pytest.raises(GeometryFault, match="2 pairs of its triangles coincide and look opposite ways"):
        face_of(sheets(), lambda c, n: abs(n[:, 2]) > 0.5)


def test_ten_million_triangles_are_refused_with_their_number_before_they_are_read(tmp_path):
    path = tmp_path / "huge.stl"
    with path.open("wb") as file:
        file.write(b"\0" * 80 + (10_000_000).to_bytes(4, "little"))
        file.truncate(84 + 50 * 10_000_000)
    with pytest.raises(GeometryFault, match=f"10000000 triangles, more than the limit of {MAX_TRIANGLES}"):
        shape(tc.Mesh(path))
    (tmp_path / "huge.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 3\nelement face 10000000\nend_header\n")
    with pytest.raises(GeometryFault, match="10000000 triangles"):
        shape(tc.Mesh(tmp_path / "huge.ply"))


@pytest.mark.parametrize("suffix", ["stl", "ply"])
def test_files_with_corners_that_are_no_numbers_are_refused(suffix, tmp_path):
    bad = trimesh.Trimesh(BLOCK.vertices * np.where(np.arange(8) == 3, np.nan, 1)[:, None], BLOCK.faces, process=False)
    bad.export(tmp_path / f"bad.{suffix}")
    with pytest.raises(GeometryFault, match="not finite"):
        shape(tc.Mesh(tmp_path / f"bad.{suffix}"))


def test_words_in_a_ply_header_are_not_its_counts(tmp_path):
    text = "ply\nformat ascii 1.0\ncomment front face 2000000 x\nelement vertex 3\nproperty float x\nproperty float y\n"
    text += (
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    (tmp_path / "one.ply").write_text(text)
    assert len(shape(tc.Mesh(tmp_path / "one.ply")).mesh.faces) == 1


def test_a_mask_is_not_taken_for_indices():
    part = tc.Assembly("mask").part("part", tc.Mesh(BLOCK))
    mask = BLOCK.face_normals[:, 2] > 0.9
    assert "np.flatnonzero(mask)" in next(part.face(mask.tolist()).faults())
    assert "np.flatnonzero(mask)" in next(part.face(mask).faults())
    assert not list(part.face(np.flatnonzero(mask)).faults())
    with pytest.raises(TypeError, match="cannot be chosen by 5"):
        part.face(5)


def lid_on(path, units=None):
    a = tc.Assembly("units")
    lid = a.part("lid", tc.Mesh(path, units))
    table = a.part("table", tc.Box(300, 300, 10), at=(0, 0, -10), fixed=True)
    a.locate(lid, tc.three_two_one(lid.face("-z"), lid.face("-y"), lid.face("-x")), tolerance=1)
    a.contact("rest", moving=lid.face("-z"), reference=table.face("+z"), points=9)
    a.measure("height", lid.point(0, 0, 0), along="z")
    return a


def test_a_mesh_in_inches_taken_as_mm_is_warned_of_by_its_size(tmp_path):
    path = tmp_path / "lid.stl"
    trimesh.creation.box(bounds=[[0, 0, 0], [8, 6, 1]]).export(path)  # inches
    with pytest.warns(UnitsWarning, match='part "lid".*10.05 mm across, but "table", which it touches, 424.4 mm.*255.3 mm'):
        discretize(lid_on(path))
    wrongly = lid_on(path, "mm")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        discretize(wrongly)
        assert discretize(lid_on(path, "in")).parts[0].mesh.extents[0] == pytest.approx(203.2)
    wrongly.measure("far end", wrongly.parts[0].point(203.2, 0, 0), along="z")
    with pytest.warns(UnitsWarning, match='10.05 mm across, but the point of measure "far end" lies 195.2 mm away from it'):
        discretize(wrongly)


def tessellated(n):
    """The top of a block, 50 x 25 mm, as 2 n^2 triangles, turned so that no triangle's edge runs along the block's."""
    x, y = np.meshgrid(np.linspace(0, 50, n + 1), np.linspace(0, 25, n + 1), indexing="ij")
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.r_[np.c_[corner, corner + n + 1, corner + n + 2], np.c_[corner, corner + n + 2, corner + 1]]
    return trimesh.Trimesh(np.c_[x.ravel(), y.ravel(), np.zeros(x.size)], faces[:, ::-1])


@pytest.mark.parametrize("n", [1, 3, 10, 150])
def test_contact_points_follow_the_spacing_and_not_the_tessellation(n):
    a = tc.Assembly("resampled")
    table = a.part("table", tc.Box(50, 25, 10), at=(0, 0, -10), fixed=True)
    sheet = a.part("sheet", tc.Mesh(tessellated(n)))
    points = [(5, 5, 0), (45, 5, 0), (25, 20, 0)]
    sides = [tc.Locator("B1", (5, 0, 0), "y"), tc.Locator("B2", (45, 0, 0), "y"), tc.Locator("C", (0, 10, 0), "x")]
    a.locate(sheet, [*(tc.Locator(f"A{k}", p, "z") for k, p in enumerate(points)), *sides], tolerance=1)
    a.contact("rest", moving=sheet.face("-z"), reference=table.face("+z"), spacing=2.5)
    a.measure("height", sheet.point(0, 0, 0), along="z")
    (pair,) = discretize(a).pairs
    apart = np.linalg.norm(pair.P_m[:, None] - pair.P_m, axis=2) + np.eye(len(pair.P_m)) * 99
    spots = np.random.default_rng(0).uniform([0, 0, 0], [50, 25, 0], (1000, 3))
    assert np.linalg.norm(spots[:, None] - pair.P_m, axis=2).min(axis=1).max() < 2.5 + 0.9
    assert apart.min() > 1.2
    assert 120 < len(pair.P_m) < 260
    for corner in ((0, 0), (50, 0), (0, 25), (50, 25)):
        assert np.abs(pair.P_m[:, :2] - corner).max(axis=1).min() < 1e-12


@pytest.mark.parametrize("solid", ["sphere", "cylinder"])
def test_points_on_curved_faces_lie_on_them_and_look_outward(solid):
    """A shell around a ball or a bar: its points are projected onto it."""
    inner, outer = (
        trimesh.creation.icosphere(4, r) if solid == "sphere" else trimesh.creation.cylinder(r, 40, sections=96)
        for r in (10, 10.5)
    )
    outer.invert()
    around = trimesh.util.concatenate([outer, trimesh.creation.box((60, 60, 60))])
    points, directions = [(5, 5, 0), (-5, 5, 0), (0, -5, 0), (0, 5, 0), (0, -5, 0), (5, 0, 0)], "zzzxxy"
    six = [tc.Locator(f"L{k}", p, n) for k, (p, n) in enumerate(zip(points, directions, strict=True))]
    a = tc.Assembly(solid)
    core = a.part("core", tc.Mesh(inner), fixed=True)
    shell = a.part("shell", tc.Mesh(around))
    a.locate(shell, six, tolerance=0.1)
    steep = 2 if solid == "sphere" else 0.1  # of the bar the barrel only
    inside = shell.face(lambda c, n: (np.linalg.norm(c, axis=1) < 23) & (abs(n[:, 2]) < steep), tc.Inside([-15] * 3, [15] * 3))
    a.contact("around", moving=inside, reference=core.face(lambda c, n: abs(n[:, 2]) < steep), points=500)
    a.measure("height", shell.point(0, 0, 0), along="z")
    (pair,) = discretize(a).pairs
    assert len(pair.P_m) > 400
    true = pair.P_r * ([1, 1, 1] if solid == "sphere" else [1, 1, 0])
    radius = np.linalg.norm(true, axis=1)
    chord = 10 * (1 - np.cos(np.pi / 96)) if solid == "cylinder" else 10 - np.linalg.norm(inner.triangles_center, axis=1).min()
    assert 10 - radius.min() < chord + 1e-9 and radius.max() < 10 + 1e-9
    assert np.abs(pair.n_r - true / radius[:, None]).max() < 0.005


def test_halving_the_spacing_moves_measures_on_curved_faces_by_less_than_their_interval():
    method = replace(ALL_POINTS, search="iterated")
    runs = [simulate(cases.bar_in_a_half_pipe(spacing), samples=300, solver="daqp", method=method) for spacing in (6, 3)]
    few, many = (len(program.nominal.pairs[0].P_m) for program, _ in runs)
    assert many > 3 * few
    coarse, fine = (run["measured"][:, CORRECTED] for _, run in runs)
    for k in range(2):
        for estimate in (intervals.mean, intervals.standard_deviation):
            _, lower, upper = estimate(coarse[:, k])
            assert lower < estimate(fine[:, k])[0] < upper


def test_the_bodies_of_a_scene_stand_in_their_places(tmp_path):
    scene = trimesh.Scene()
    for k in range(3):
        scene.add_geometry(BLOCK, transform=trimesh.transformations.translation_matrix((20 * k, 0, 5 * k)))
    scene.export(tmp_path / "three.glb")
    mesh = shape(tc.Mesh(tmp_path / "three.glb", units="mm")).mesh
    assert mesh.body_count == 3
    assert mesh.bounds.tolist() == [[0, 0, 0], [50, 20, 40]]
    assert mesh.volume == pytest.approx(3 * BLOCK.volume)
