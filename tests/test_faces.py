"""Faces that are picked from a part: by a direction, a box, a point of a B-rep face, a neighbour, a function."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.shapes import BLOCK, HOUSING, face_of, patch, shape
from tolcontact.errors import GeometryFault


@pytest.mark.parametrize(
    ("at", "words"), [((60, 40, 90), "mm away"), ((19, 15, 40), "where 2 faces meet"), ((60, 0, 0), "where 2 faces meet")]
)
def test_a_brep_face_that_is_not_clear_is_refused(at, words):
    with pytest.raises(GeometryFault, match=words):
        face_of(HOUSING, tc.select.Brep(at))
    with pytest.raises(GeometryFault, match="not a STEP file"):
        face_of(BLOCK, tc.select.Brep((5, 5, 30)))


def test_criteria_are_met_together():
    assert face_of(BLOCK, "+z").mesh.area == pytest.approx(200)
    assert face_of(BLOCK).mesh.area == pytest.approx(BLOCK.area)
    assert face_of(BLOCK, "+z", tc.select.Inside((2, 3, 0), (7, 5, 30))).mesh.area == pytest.approx(10)
    assert face_of(BLOCK, tc.select.Inside((0, 0, 15), (10, 20, 30)), lambda c, n: n[:, 2] < 0.5).mesh.area == pytest.approx(
        900
    )
    assert face_of(BLOCK, tc.select.Facing((1, 1, 0), 0.8)).mesh.area == pytest.approx(200 * 3 / 2 * 3)
    with pytest.raises(GeometryFault, match=r"nothing of it lies in that box; the part spans \(0, 0, 0\) to \(10, 20, 30\)"):
        face_of(BLOCK, "+z", tc.select.Inside((0, 0, 0), (10, 20, 29)))
    with pytest.raises(GeometryFault, match="no triangles"):
        face_of(BLOCK, "+z", "-z")


def test_a_cut_face_keeps_the_normals_of_the_whole():
    barrel = trimesh.creation.cylinder(10, 40, sections=48)
    cut = face_of(barrel, lambda c, n: abs(n[:, 2]) < 0.1, tc.select.Inside((-11, -11, -3), (11, 3, 11)))
    points, _ = trimesh.sample.sample_surface(cut.mesh, 300, seed=1)
    nearest, normals, _ = cut.project(points)
    assert points[:, 2].min() > -3 and points[:, 1].max() < 3
    radial = np.c_[nearest[:, :2], 0 * nearest[:, 0]]
    assert np.abs(normals - radial / np.linalg.norm(radial, axis=1, keepdims=True)).max() < (np.pi / 48) ** 2


def test_the_face_near_another_part_is_the_one_that_looks_at_it():
    a = tc.Assembly("near")
    table = a.part("table", tc.Box(50, 50, 10), at=(0, 0, -10), fixed=True)
    block = a.part("block", tc.Mesh(BLOCK), at=(30, 5, 0.2), rotation=(0, 0, np.pi / 2))
    meshes = {part: shape(part.geometry) for part in (table, block)}
    assert patch(block.face(tc.select.Near(table, 0.3)), meshes).mesh.area == pytest.approx(200)
    assert patch(table.face(tc.select.Near(block, 0.3)), meshes).mesh.area == pytest.approx(2500)
    with pytest.raises(GeometryFault, match="no triangles"):
        patch(block.face(tc.select.Near(table, 0.1)), meshes)


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
    meshes = {part: shape(part.geometry) for part in (plate, pad)}
    assert patch(plate.face(tc.select.Near(pad, 0.1)), meshes).mesh.area == pytest.approx(700_000)
    assert patch(pad.face(tc.select.Near(plate, 0.1)), meshes).mesh.area == pytest.approx(16)


@pytest.mark.slow
def test_what_is_near_on_a_large_barrel_is_not_the_whole_barrel():
    a = tc.Assembly("barrel")
    barrel = a.part("barrel", tc.Mesh(trimesh.creation.cylinder(200, 10, sections=700)), fixed=True)
    block = a.part("block", tc.Box(10, 10, 10), at=(200.1, -5, -5))
    meshes = {part: shape(part.geometry) for part in (barrel, block)}
    near = patch(barrel.face(tc.select.Near(block, 0.5)), meshes).mesh
    assert near.bounds[0, 0] > 199
    assert 100 < near.area < 400


def test_what_is_near_on_a_ball_are_its_lowest_triangles():
    """As near as the centres of small pieces of triangles: some triangles reach nearer than their own centres."""
    ball = trimesh.creation.icosphere(3, 20.0)
    a = tc.Assembly("ball")
    table = a.part("table", tc.Box(100, 100, 10), at=(-50, -50, -30.5), fixed=True)
    part = a.part("ball", tc.Mesh(ball))
    meshes = {part: shape(part.geometry) for part in (table, part)}
    for within in (0.55, 1.0, 3.0):
        near = patch(part.face(tc.select.Near(table, within)), meshes).mesh
        heights = np.asarray(near.triangles)[:, :, 2] + 20.5
        assert heights.min(axis=1).max() <= within
        assert len(near.faces) >= (ball.triangles_center[:, 2] + 20.5 <= within).sum() and len(near.faces) > 0
        moved = a.part(f"ball {within}", tc.Mesh(ball), at=(0, 0, 30))  # the same mesh elsewhere is not near
        with pytest.raises(GeometryFault, match="no triangles"):
            patch(moved.face(tc.select.Near(table, within)), meshes | {moved: meshes[part]})


def test_a_mask_is_not_taken_for_indices():
    part = tc.Assembly("mask").part("part", tc.Mesh(BLOCK))
    mask = BLOCK.face_normals[:, 2] > 0.9
    assert "np.flatnonzero(mask)" in next(part.face(mask.tolist()).faults())
    assert "np.flatnonzero(mask)" in next(part.face(mask).faults())
    assert not list(part.face(np.flatnonzero(mask)).faults())
    with pytest.raises(TypeError, match="cannot be chosen by 5"):
        part.face(5)
