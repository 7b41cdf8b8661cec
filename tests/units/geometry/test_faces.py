"""Insides of `geometry` under the claims of `tests/test_faces.py`."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.shapes import HOUSING, face_of
from tolcontact import poses as pose
from tolcontact.geometry.face_pair import FacePair, body_face
from tolcontact.geometry.files.reading import STEP_CHORD


def test_a_brep_face_is_found_by_a_point_on_it():
    hole = face_of(HOUSING, tc.select.Brep((19, 15, 35)))  # radius 4 about (15, 15), 12 deep
    points, _ = trimesh.sample.sample_surface(hole.mesh, 500, seed=1)
    nearest, normals, over = hole.project(points)
    radius = np.linalg.norm(nearest[:, :2] - [15, 15], axis=1)
    assert over.all()
    assert radius.max() < 4 + 1e-5 and radius.min() > 4 - STEP_CHORD
    out_of_the_material = ([15, 15] - nearest[:, :2]) / radius[:, None]
    assert np.abs(normals - np.c_[out_of_the_material, 0 * radius]).max() < 1e-3
    assert hole.mesh.area == pytest.approx(2 * np.pi * 4 * 12, rel=1e-3)


def test_a_place_off_a_hole_is_projected_along_its_radius_though_facets_are_flat():
    hole = face_of(HOUSING, tc.select.Brep((19, 15, 35)))  # its facets reach from rim to rim
    rng = np.random.default_rng(2)
    angle, low, high = rng.uniform(0, 2 * np.pi, 300), *hole.mesh.bounds[:, 2]
    around, z = np.c_[np.cos(angle), np.sin(angle)], rng.uniform(low + 0.1, high - 0.1, 300)
    nearest, _, over = hole.project(np.c_[[15, 15] + 3.5 * around, z])
    assert over.all()
    np.testing.assert_allclose(nearest, np.c_[[15, 15] + 4 * around, z], atol=1e-9)


@pytest.mark.parametrize("turn", [0.0, 1e-3, 0.2])
def test_faces_penetrate_each_other_where_their_depth_is_not_0(turn):
    table, block = (trimesh.creation.box(extents) for extents in ((100, 60, 10), (40, 30, 10)))
    faces = FacePair(*(
        body_face(face_of(body, lambda c, n, up=up: n[:, 2] * up > 0.9), body, 4) for body, up in ((block, -1), (table, 1))
    ))  # fmt: skip
    rng = np.random.default_rng(2)
    t = rng.normal([0, 0, 10], [30, 20, 0.01], (60, 3))
    X = pose.pose(Rotation.from_rotvec(rng.normal(0, turn, (60, 3))).as_matrix(), t)
    depths = faces.depth(X, np.zeros(60))
    assert 0 < (depths > 0).sum() < 60
    np.testing.assert_array_equal(faces.penetrate(X, np.zeros(60)), depths > 0)
