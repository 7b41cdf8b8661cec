"""Insides of `geometry` under the claims of `tests/test_form.py`."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tolcontact.discretization import discretize
from tolcontact.geometry.region_kernel import keep_over


@pytest.mark.parametrize("turn", [(0, 0, 0), (0.3, -0.7, 0.2)])
def test_points_over_a_flat_face_with_a_hole_are_those_that_project_onto_it(turn):
    a = tc.Assembly("ring")
    part = a.part("ring", tc.Mesh(trimesh.creation.annulus(15, 40, 20, sections=48)), fixed=True)
    part.feature("top", part.face("+z"), tc.Flatness(0.05))
    a.measure("corner", part.point(20, 0, 10), along="z")
    R, t = Rotation.from_euler("xyz", turn).as_matrix(), np.array([3.0, -2.0, 7.0])
    face = discretize(a).features[0].surfaces[0].placed(R, t)
    places = np.random.default_rng(0).uniform((-42, -42, 9), (42, 42, 11), (4000, 3)) @ R.T + t
    numbers, at_rest = np.arange(4000)[None].copy(), np.array([[1.0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]])
    keep_over(at_rest, places, np.zeros((1, 0, 3)), face.region, face.region, numbers)
    np.testing.assert_array_equal(numbers[0] >= 0, face.project(places)[2])
    assert 0.5 < (numbers >= 0).mean() < 0.8
