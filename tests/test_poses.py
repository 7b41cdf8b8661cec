"""Batches of poses, of any shape, against rotation matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tolcontact import poses

RNG = np.random.default_rng(7)


def some(*shape):
    """Rotations, translations and poses (*shape, 12)."""
    R = Rotation.random(int(np.prod(shape)), rng=RNG).as_matrix().reshape(*shape, 3, 3)
    t = RNG.normal(size=(*shape, 3))
    return R, t, poses.pose(R, t)


@pytest.mark.parametrize("shape", [(5,), (4, 2), (1, 3, 2)])
def test_points_go_where_rotation_and_translation_bring_them(shape):
    R, t, X = some(*shape)
    assert X.shape == (*shape, 12) and (poses.rotation(X) == R).all()
    p = RNG.normal(size=(7, 3))
    expected = np.einsum("...ij,pj->...pi", R, p) + t[..., None, :]
    assert np.abs(poses.apply(X, p) - expected).max() < 1e-14
    assert (poses.apply(poses.AT_REST, p) == p).all()


@pytest.mark.parametrize("shape", [(5,), (4, 2)])
def test_composition_is_one_motion_after_the_other_and_the_inverse_undoes_it(shape):
    (_, _, X), (_, _, Y) = some(*shape), some(*shape)
    p = RNG.normal(size=(1, 3))
    twice = np.einsum("...ij,...j->...i", poses.rotation(X), poses.apply(Y, p)[..., 0, :]) + X[..., 9:]
    assert np.abs(poses.apply(poses.compose(X, Y), p)[..., 0, :] - twice).max() < 1e-14
    assert np.abs(poses.compose(poses.inverse(X), X) - poses.AT_REST).max() < 1e-14
    stretched = X * 1.01  # poses of the linearized resolution stretch a little
    assert np.abs(poses.compose(stretched, poses.inverse(stretched)) - poses.AT_REST).max() < 1e-14


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.3, 2.0, np.pi])
def test_the_turn_between_two_poses_is_their_angle(angle):
    R, t, X = some(6)
    axis = RNG.normal(size=3)
    Y = poses.pose(R @ Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix(), t + 1)
    assert poses.turn(X, Y) == pytest.approx(np.full(6, angle), abs=1e-7)


def test_half_a_turn_is_an_angle_in_spite_of_rounding():
    R, t, X = some(500)
    half = poses.pose(R @ Rotation.from_rotvec(np.pi * R[:, 0]).as_matrix(), t)
    apart = ((X - half)[:, :9] ** 2).sum(axis=1)
    assert (apart > 8).any() and poses.turn(X, half) == pytest.approx(np.pi, abs=1e-6)
