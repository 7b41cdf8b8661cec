"""Insides of `geometry` under the claims of `tests/test_discretization.py`."""

import numpy as np
import pytest
import trimesh

from tolcontact.geometry.spreading import spread
from tolcontact.geometry.surface import Surface


def face(width, height):
    return trimesh.Trimesh([[0, 0, 0], [width, 0, 0], [width, height, 0], [0, height, 0]], [[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("count", [1, 4, 202, 1000])
def test_points_are_as_many_as_asked_and_spread_evenly(count):
    points = spread(face(50, 25), count, None)
    assert points.shape == (count, 3)
    assert ((points >= 0) & (points <= [50, 25, 0])).all()
    if count >= 202:
        # Each cell of area 1/count of the face holds about one point: no hole and no heap.
        radius = np.sqrt(50 * 25 / count)
        spots = np.random.default_rng(0).uniform([0, 0, 0], [50, 25, 0], (2000, 3))
        apart = np.linalg.norm(points[:, None] - points, axis=2) + np.eye(count) * 99
        assert np.linalg.norm(spots[:, None] - points, axis=2).min(axis=1).max() < 1.1 * radius
        assert apart.min() > 0.5 * radius
        for corner in ((0, 0), (50, 0), (0, 25), (50, 25)):
            assert np.abs(points[:, :2] - corner).max(axis=1).min() == 0


def test_a_spacing_is_kept_everywhere():
    points = spread(face(50, 25), None, 4.0)
    spots = np.random.default_rng(0).uniform([0, 0, 0], [50, 25, 0], (2000, 3))
    assert np.linalg.norm(spots[:, None] - points, axis=2).min(axis=1).max() <= 4.0 + 1.0


@pytest.mark.parametrize("solid", [trimesh.creation.icosphere(4, 10), trimesh.creation.cylinder(10, 40, sections=96)])
def test_projections_on_curved_faces_lie_on_them_with_normals_outward(solid):
    rng = np.random.default_rng(1)
    direction = rng.normal(size=(200, 3))
    if len(solid.vertices) < 1000:  # the cylinder's barrel
        direction[:, 2] = 0
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    nearest, normals, over = Surface(solid).project(direction * 11)
    chord = 10 * (1 - np.cos(np.pi / 48))
    assert over.all()
    assert np.abs(np.linalg.norm(nearest, axis=1) - 10).max() < chord
    assert ((normals * direction).sum(axis=1) > 0.99).all()
