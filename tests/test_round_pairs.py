"""Which pairs touch as balls and shafts beside walls do, and which have sampled points; what is said of them."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tests.cases import round_contact as round_cases
from tests.helpers import call
from tests.shapes import patch
from tolcontact.discretization import discretize


@pytest.mark.slow
def test_check_says_which_pairs_are_round():
    listed = call(cases.MODELS, "check", "cover.py").stdout
    assert "contact seat: 78 contact points; they are fixed, and err by 0 mm at most\n" in listed
    assert "contact round hole: 12 contact points, exact on round faces; triangles up to 0.00061 mm inside\n" in listed


@pytest.mark.slow
def test_what_is_not_a_ball_or_a_shaft_beside_a_wall_has_points():
    def pair(pin, reference, **options):
        a = tc.Assembly("not round")
        plate = a.part("plate", reference, fixed=True)
        moving = a.part("pin", tc.Mesh(pin))
        a.locate(moving, round_cases.held(moving, [(4, 0, 0), (-4, 0, 0), (0, 4, 0), (0, 0, 0), (0, 0, 0), (4, 0, 0)], 0.1))
        a.contact(
            "fit", moving=moving.face(tc.select.Cylinder()), reference=plate.face(tc.select.Cylinder(radius=5.05)), **options
        )
        a.measure("x", moving.point(0, 0, 0), along="x")
        (found,) = discretize(a).pairs
        return found

    hole = tc.Mesh(trimesh.creation.annulus(5.05, 20, 10, sections=48))
    upright = trimesh.creation.cylinder(5, 20, sections=48)
    assert not pair(upright, hole).samples_faces
    assert pair(upright, hole, points=100).samples_faces and pair(upright, hole, spacing=1.0).samples_faces
    askew = upright.copy()
    askew.apply_transform(trimesh.transformations.rotation_matrix(0.005, [1, 0, 0]))
    assert pair(askew, hole).samples_faces  # its axis is not that of the hole
    half = upright.copy()
    half.update_faces(half.triangles_center[:, 0] > 0)
    assert pair(half, hole).samples_faces  # it is not round on all sides


def pair_between(moving, own, reference, other, at=(0, 0, 0)):
    """The pair of two meshes whose faces are chosen; the moving one is held."""
    a = tc.Assembly("pair")
    fixed = a.part("fixed", tc.Mesh(reference), fixed=True)
    part = a.part("part", tc.Mesh(moving), at=at)
    a.locate(part, round_cases.held(part, [(4, 0, 0), (-4, 0, 0), (0, 4, 0), (0, 0, 0), (0, 0, 0), (4, 0, 0)], 1.0))
    a.contact("pair", moving=part.face(*own), reference=fixed.face(*other), within=3)
    a.measure("x", part.point(0, 0, 0), along="x")
    (found,) = discretize(a).pairs
    return found


def strip(points, length=40.0):
    """An open surface: a polyline in the plane x, z that is drawn out along y, seen from its left."""
    p = np.array([(x, y, z) for x, z in points for y in (-length / 2, length / 2)], dtype=float)
    faces = [f for k in range(0, len(p) - 2, 2) for f in ((k, k + 2, k + 1), (k + 1, k + 2, k + 3))]
    return trimesh.Trimesh(p, faces, process=False)


BALL = trimesh.creation.icosphere(3, radius=5)


def ANY(centres, normals):
    return np.ones(len(centres), dtype=bool)


def grooved(radius, half, sides=40):
    azimuths = np.linspace(-half, half, sides + 1) - np.pi / 2
    return strip(list(zip(radius * np.cos(azimuths), radius * np.sin(azimuths), strict=True)))


@pytest.mark.nightly
@pytest.mark.slow
def test_a_ball_beside_edges_gaps_and_curves_that_are_not_known_has_points():
    floor = strip([(-20, 0), (20, 0)])
    assert not pair_between(BALL, (), floor, (ANY,), at=(0, 0, 5)).samples_faces
    step = strip([(-20, 0), (5, 0), (5, 2), (20, 2)])
    assert pair_between(BALL, (), step, (ANY,), at=(0.3, 0, 5)).samples_faces  # the step's edge is near
    trough = strip([(14 * np.sin(t), -8 * np.cos(t)) for t in np.linspace(-1.5, 1.5, 20)])
    assert pair_between(BALL, (), trough, (ANY,), at=(0, 0, -2.9)).samples_faces
    assert not pair_between(BALL, (), grooved(6, 1.5), (ANY,), at=(0, 0, -0.9)).samples_faces
    lying = trimesh.creation.cylinder(5, 30, sections=48)
    lying.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    barrel = (tc.select.Cylinder(),)
    assert not pair_between(lying, barrel, grooved(5.2, 1.5), (ANY,), at=(0, 0, -0.1)).samples_faces
    assert pair_between(lying, barrel, grooved(4.9, 1.5), (ANY,), at=(0, 0, 0.1)).samples_faces
    small = grooved(4.5, 1.5)
    assert pair_between(BALL, (), small, (ANY,), at=(0, 0, 2)).samples_faces  # it rests on the groove's edges


@pytest.mark.slow
def test_walls_that_are_not_whole_between_their_ends_are_none():
    pin = trimesh.creation.cylinder(5, 20, sections=48)
    for gaps, is_round in ((1, True), (2, False), (3, False)):
        bore = trimesh.creation.annulus(5.05, 8, 10, sections=72)
        azimuth = np.arctan2(bore.triangles_center[:, 1], bore.triangles_center[:, 0])
        apart = np.abs((azimuth[:, None] - 2 * np.pi * np.arange(gaps) / gaps + np.pi) % (2 * np.pi) - np.pi).min(axis=1)
        bore.update_faces(apart > 0.35)
        assert pair_between(pin, (tc.select.Cylinder(),), bore, (tc.select.Cylinder(radius=5.05),)).samples_faces != is_round


def test_faces_that_look_opposite_ways_are_two():
    """A pin above, and a blind hole of its radius below, in line."""
    pin, hole = trimesh.creation.cylinder(5, 10, sections=48), trimesh.creation.annulus(5, 8, 10, sections=48)
    hole.apply_translation([0, 0, -20])
    both = trimesh.util.concatenate([pin, hole])
    part = tc.Assembly("stacked").part("part", tc.Mesh(both))
    face = patch(part.face(tc.select.Cylinder(radius=5)), {part: both})
    assert sorted(piece.is_hollow for piece in face.pieces) == [False, True]
    for k, piece in enumerate(face.pieces):
        normals = face.corner_normals[face.surface_numbers == k].mean(axis=1)
        assert ((normals * piece.face.mesh.face_normals).sum(axis=1) > 0.9).all()


def test_points_on_the_axis_of_a_hole_do_not_touch_its_wall():
    plug = trimesh.creation.cylinder(19.9, 10, sections=90)
    bore = trimesh.creation.annulus(20, 30, 20, sections=90)
    pair = pair_between(plug, (ANY,), bore, (tc.select.Cylinder(radius=20),))
    assert pair.samples_faces and (np.hypot(pair.P_m[:, 0], pair.P_m[:, 1]) > 17).all()


def test_flat_faces_are_flat_however_they_are_turned():
    fine = trimesh.creation.box(bounds=[[-20, -20, -2], [20, 20, 0]]).subdivide().subdivide().subdivide()
    for turn in np.random.default_rng(1).normal(size=(4, 3)):
        a = tc.Assembly("turned")
        frame = cases.Frame(turn)
        floor = a.part("floor", tc.Mesh(fine), **frame.place(0, 0, 0), fixed=True)
        ball = a.part("ball", tc.Mesh(BALL), **frame.place(0, 0, 5))
        a.locate(ball, round_cases.held(ball, [(4, 0, 0), (-4, 0, 0), (0, 4, 0), (0, 0, 0), (0, 0, 0), (4, 0, 0)], 1.0))
        a.contact("rest", moving=ball.face(), reference=floor.face("+z"))
        a.measure("height", ball.point(0, 0, 0), along="z")
        assert len(discretize(a).pairs[0].P_m) == 1
