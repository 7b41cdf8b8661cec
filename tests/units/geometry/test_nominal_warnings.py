"""Insides of `geometry` under the claims of `tests/test_nominal_warnings.py`."""

import igl
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from tests.helpers import nightly
from tolcontact.geometry.body_overlap import SolidBody, common_ball


@pytest.mark.parametrize("seed", [1, *nightly(2, 3, 4)])
def test_the_common_ball_of_blocks_is_as_thick_as_their_overlap(seed):
    rng = np.random.default_rng(seed)
    for thickness in (5.0, 1.0, 0.3):
        R = Rotation.random(random_state=seed)
        turned = np.eye(4)
        turned[:3, :3] = R.as_matrix()
        blocks = [trimesh.creation.box((50, 30, 10)) for _ in range(2)]
        blocks[1].apply_translation((*rng.uniform(-10, 10, 2), 10 - thickness))
        bodies = [SolidBody(block.apply_transform(turned)) for block in blocks]
        diameter, centre = common_ball(*bodies, 0.2)
        assert thickness * 0.9 <= diameter <= thickness * (1 + 1e-9)
        assert R.inv().apply(centre)[2] == pytest.approx(5 - thickness / 2, abs=thickness / 10)
        assert common_ball(*bodies, 1.01 * thickness) is None


def test_the_common_ball_of_spheres_and_of_one_body_in_another():
    spheres = [trimesh.creation.icosphere(subdivisions=3, radius=10) for _ in range(2)]
    spheres[1].apply_translation((12, 5, 0))
    diameter, centre = common_ball(*map(SolidBody, spheres), 0.2)
    assert diameter == pytest.approx(20 - 13, rel=0.1)
    assert centre == pytest.approx((6, 2.5, 0), abs=1)
    small = trimesh.creation.box((2, 2, 2))
    assert common_ball(SolidBody(spheres[0]), SolidBody(small), 0.05)[0] == pytest.approx(2, rel=0.1)
    assert common_ball(SolidBody(small), SolidBody(small), 0.05)[0] == pytest.approx(2, rel=0.1)


def test_depths_agree_with_planes_and_winding_numbers():
    points = np.random.default_rng(1).uniform(-12, 12, (2000, 3))
    for mesh in (trimesh.creation.icosphere(2, 10), trimesh.creation.box((9, 5, 2))):  # convex
        heights = ((points[:, None] - mesh.triangles_center) * mesh.face_normals).sum(axis=2).max(axis=1)
        depths = SolidBody(mesh).depth(points)
        assert (depths > 0).any() and (depths[heights > 0] < 0).all()
        assert depths[heights < 0] == pytest.approx(-heights[heights < 0], abs=1e-9)
    ring = trimesh.creation.annulus(5, 11, 10, sections=24)
    turns = igl.winding_number(np.array(ring.vertices), np.array(ring.faces, dtype=np.int64), points)
    assert ((SolidBody(ring).depth(points) > 0) == (turns > 0.5)).all()
