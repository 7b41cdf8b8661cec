"""Shapes from files and meshes: their units, and which of them have an outside."""

import warnings

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.shapes import BLOCK, HOUSING, face_of, shape
from tolcontact.errors import GeometryFault


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "glb"])
def test_meshes_are_read_in_the_units_of_their_kind(suffix, tmp_path):
    path = tmp_path / f"block.{suffix}"
    BLOCK.copy().apply_scale(1e-3 if suffix == "glb" else 1).export(path)
    mesh = shape(tc.Mesh(path))
    assert mesh.extents == pytest.approx([10, 20, 30], rel=1e-6)
    assert mesh.is_watertight and len(mesh.vertices) == 8
    assert shape(tc.Mesh(path, units="in")).extents[0] == pytest.approx(254 if suffix != "glb" else 0.254, rel=1e-6)


def test_a_trimesh_is_taken_in_its_own_units_and_stays_as_it_was():
    own = BLOCK.copy()
    own.units = "inches"
    assert shape(tc.Mesh(own)).extents == pytest.approx([254, 508, 762])
    assert shape(tc.Mesh(own, units="mm")).extents == pytest.approx([10, 20, 30])
    assert own.extents == pytest.approx([10, 20, 30])
    own.units = "furlong"
    with pytest.raises(GeometryFault, match="furlong"):
        shape(tc.Mesh(own))


def test_step_comes_in_mm_with_flat_faces_where_they_were_drawn():
    mesh = shape(tc.Mesh(HOUSING))
    assert mesh.is_watertight
    assert mesh.bounds.tolist() == [[0, 0, 0], [120, 80, 40]]
    top = mesh.triangles[mesh.face_normals[:, 2] > 0.999]
    assert set(np.unique(top[:, :, 2])) == {10.0, 28.0, 40.0}  # cavity, bottoms of the holes, rim


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
    "vertices that are not": (trimesh.Trimesh(np.eye(3), [[0, 1, 5]], process=False), "vertices beyond the 3"),
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
    "neighbours oriented inconsistently": (twisted(), "oriented inconsistently at 3 edges"),
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
    assert face_of(sheets(), "+z", tc.select.Inside((0, 0, -1), (9, 9, 1))).mesh.area == pytest.approx(81)
    with pytest.raises(GeometryFault, match="2 pairs of coincident triangles point opposite ways"):
        face_of(sheets(), lambda c, n: abs(n[:, 2]) > 0.5)


def lid_on(path, units=None):
    a = tc.Assembly("units")
    lid = a.part("lid", tc.Mesh(path, units))
    table = a.part("table", tc.Box(300, 300, 10), at=(0, 0, -10), fixed=True)
    a.locate(lid, tc.three_two_one(lid.face("-z"), lid.face("-y"), lid.face("-x")), tolerance=1)
    a.contact("rest", moving=lid.face("-z"), reference=table.face("+z"), points=9)
    a.measure("height", lid.point(0, 0, 0), along="z")
    return a


@pytest.mark.slow
def test_a_mesh_in_inches_taken_as_mm_is_warned_of_by_its_size(tmp_path):
    path = tmp_path / "lid.stl"
    trimesh.creation.box(bounds=[[0, 0, 0], [8, 6, 1]]).export(path)  # inches
    expected = r'\[units\] part "lid".*10.05 mm across, but "table", which it touches, is 424.4 mm.*255.3 mm'
    with pytest.warns(tc.NominalWarning, match=expected):
        tc.build(lid_on(path))
    wrongly = lid_on(path, "mm")
    with warnings.catch_warnings():
        warnings.filterwarnings("error", r"\[units\]")
        tc.build(wrongly)
        assert tc.build(lid_on(path, "in")).nominal.parts[0].mesh.extents[0] == pytest.approx(203.2)
    wrongly.measure("far end", wrongly.parts[0].point(203.2, 0, 0), along="z")
    expected = r'\[units\] .*10.05 mm across, but the point of measurement "far end" lies 195.2 mm away from it'
    with pytest.warns(tc.NominalWarning, match=expected):
        tc.build(wrongly)
