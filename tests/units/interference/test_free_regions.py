"""Regions that prove bodies apart, against the complete test without them and against closed forms."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from tolcontact.geometry.analytic_surfaces import Cylinder
from tolcontact.interference import Neighbours, solid
from tolcontact.interference.free_region import free_region

INSETS = (4e-5, 6e-5)
RADIUS, PIN, HALF, HEIGHT, SIDES = 4.05, 4.0, 2.0, 8.0, 90
SAGITTA = RADIUS * (1 - np.cos(np.pi / SIDES))


def stadium(radius, half):
    """A loop around two circles whose centres are `half` from the origin."""
    turns = 2 * np.pi * np.arange(SIDES) / SIDES
    ring = radius * np.c_[np.cos(turns), np.sin(turns)]
    return ring + np.where(ring[:, :1] > 1e-9, half, -half) * [1, 0]


def tube(inner, outer, low, high):
    """A body between two loops (n, 2); `inner` None leaves out the hole."""
    loops = [outer] if inner is None else [outer, inner]
    n, points = len(outer), [np.c_[loop, np.full(len(loop), z)] for loop in loops for z in (low, high)]
    k, after = np.arange(n), (np.arange(n) + 1) % n

    def strip(first, second):
        a, b, c, d = k + first * n, after + first * n, k + second * n, after + second * n
        return np.r_[np.c_[a, b, d], np.c_[a, d, c]]

    if inner is not None:
        faces = [strip(0, 1), strip(1, 3), strip(3, 2), strip(2, 0)]
    else:
        points += [[[0, 0, low]], [[0, 0, high]]]
        faces = [strip(0, 1), np.c_[after, k, np.full(n, 2 * n)], np.c_[k + n, after + n, np.full(n, 2 * n + 1)]]
    return trimesh.Trimesh(np.concatenate(points), np.concatenate(faces), process=False)


def size_of(body, radius, columns, outward):
    """The face on a cylinder, which grows outwards by half of its size."""
    walls = np.flatnonzero(np.abs(body.normals[:, 2]) < 0.5)
    centres = body.vertices[body.faces[walls]]
    kept = walls[np.abs(np.linalg.norm(centres[..., :2], axis=2) - radius).max(axis=1) < 1e-9]
    return kept, np.array(columns), outward * body.normals[kept][:, None, :, None].repeat(3, axis=1)


def plate(half, *, varies):
    mesh = solid(tube(stadium(RADIUS, half), stadium(RADIUS + 6, half), 0, HEIGHT))
    bulges = np.zeros(len(mesh.faces))
    inner = np.linalg.norm(np.abs(mesh.vertices[mesh.faces][..., :2]) - [half, 0], axis=2).max(axis=1) < RADIUS + 1
    bulges[inner & (np.abs(mesh.normals[:, 2]) < 0.5)] = SAGITTA
    axis = np.array([0.0, 0.0, 1.0])
    ends = [Cylinder(np.array([x, 0.0, 0.0]), axis, radius=RADIUS) for x in {-half, half}]
    faces = [size_of(mesh, RADIUS, [0], -0.5)] if varies else []
    return mesh.deviating(faces, bulges, ends)


def pin(*, low=0, varies=False):
    mesh = solid(tube(None, stadium(PIN, 0), low, HEIGHT))
    return mesh.deviating([size_of(mesh, PIN, [1], 0.5)] if varies else [], mesh.bulges)


def poses(count, spread, tilt, rng):
    turns = Rotation.from_rotvec(rng.normal(0, tilt, (count, 3)))
    shifts = rng.normal(0, spread, (count, 3)) * [1, 1, 0.1]
    return np.c_[turns.as_matrix().reshape(count, 9), shifts]


@pytest.mark.parametrize("half", [0.0, HALF])
@pytest.mark.parametrize("varies", [False, True])
@pytest.mark.parametrize("is_pin_first", [True, False])
def test_no_certificate_contradicts_the_complete_test(half, varies, is_pin_first):
    rng = np.random.default_rng(3)
    inner, outer = pin(varies=varies), plate(half, varies=varies and not half)
    A, B = (inner, outer) if is_pin_first else (outer, inner)
    X, deviations = poses(3000, 0.03, 0.002, rng), rng.normal(0, 0.02, (3000, 2))
    pair, complete = Neighbours(A, B, INSETS, 1.0), Neighbours(A, B, INSETS, 1.0, min_triangles=np.inf)
    are_apart, expected = pair.are_apart(X, deviations), complete.interfere(X, deviations)
    assert 300 < are_apart.sum() < 2700 and expected.sum() > 100
    assert not (are_apart & expected).any()
    assert (pair.interfere(X, deviations) == expected).all()


def test_a_pin_is_certified_until_it_lies_in_the_wall():
    """The pin may move by the clearance and both insets, as the complete test allows."""
    clearance = RADIUS - PIN + sum(INSETS)
    pair = Neighbours(pin(), plate(0.0, varies=False), INSETS, 1.0)
    turns = 2 * np.pi * np.arange(SIDES) / SIDES  # to corners of the pin, and along normals of facets in between
    for share, is_apart in ((0.9999, True), (1.001, False)):
        X = np.zeros((SIDES, 12))
        X[:, [0, 4, 8]] = 1
        X[:, 9:11] = share * clearance * np.c_[np.cos(turns), np.sin(turns)]
        assert (pair.are_apart(X) == is_apart).all()


def test_a_slot_has_room_along_itself():
    pair = Neighbours(pin(), plate(HALF, varies=False), INSETS, 1.0)
    X = np.zeros((2, 12))
    X[:, [0, 4, 8]], X[:, 9] = 1, [1.0, HALF + 0.2]
    assert pair.are_apart(X).tolist() == [True, False]


def test_sizes_change_the_room_of_a_pin():
    pair = Neighbours(pin(varies=True), plate(0.0, varies=True), INSETS, 1.0)
    X = np.tile(np.r_[np.eye(3).ravel(), 0.02, 0, 0], (4, 1))
    left = RADIUS - PIN - 0.02 + sum(INSETS)  # both sizes are diameters
    deviations = np.array([[0, 1.99 * left], [0, 2.01 * left], [-1.99 * left, 0], [-2.01 * left, 0]])
    assert pair.are_apart(X, deviations).tolist() == [True, False, True, False]


def test_a_hole_that_shrinks_leaves_no_room_for_a_pin_that_hardly_moves():
    pair = Neighbours(pin(), plate(0.0, varies=True), INSETS, 1.0)
    X = np.tile(np.r_[np.eye(3).ravel(), 0.02, 0, 0], (2, 1))
    left = RADIUS - PIN - 0.02 + sum(INSETS)
    assert pair.are_apart(X, np.array([[-1.99 * left, 0], [-2.01 * left, 0]])).tolist() == [True, False]


def test_the_bottom_of_a_hole_is_a_half_space():
    cup = tube(stadium(RADIUS, 0), stadium(RADIUS + 6, 0), 0, HEIGHT)
    bottom = trimesh.creation.box(bounds=[[-9, -9, -3], [9, 9, -0.001]])
    outer, inner = solid(trimesh.util.concatenate([cup, bottom])), pin()
    body = outer.deviating([], outer.bulges, plate(0.0, varies=False).cylinders)
    region = free_region(body.inset(6e-5), inner.inset(4e-5), is_forward=True)
    assert len(region.normals) == 1 and np.isfinite(region.levels).all()
    np.testing.assert_allclose(region.normals[0], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(region.levels[0], 0.001 + 6e-5, atol=1e-9)


def test_bodies_in_each_other_have_no_region():
    bodies = [solid(mesh) for mesh in (trimesh.creation.icosphere(2, 1.0), trimesh.creation.box((9, 9, 9)))]
    for outer, inner in (bodies, bodies[::-1]):
        assert free_region(outer.inset(0.1), inner.inset(0.1), is_forward=True) is None
