"""Insides of `mechanics` under the claims of `tests/test_engine.py`."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests import cases
from tolcontact.discretization import Offsets, discretize
from tolcontact.mechanics.gap import gap_map, gap_matrix

RNG = np.random.default_rng(5)


def test_only_corners_of_planar_contacts_can_be_the_deepest():
    (pair,) = discretize(cases.ra1()).pairs
    G = gap_matrix(pair)
    found = gap_map(G, pair.offsets)
    assert found.basis.shape == (13, 3) and len(found.corners) == 4
    assert np.abs(found.basis @ found.coordinates - G).max() < 1e-11
    X = np.hstack([Rotation.random(500, rng=1).as_matrix().reshape(500, 9), RNG.normal(size=(500, 3)), np.ones((500, 1))])
    gaps = X @ G
    assert np.abs(gaps.min(axis=1) - gaps[:, found.corners].min(axis=1)).max() < 1e-11


@pytest.mark.parametrize(("coordinates", "corners"), [([[3.0, 1.0, 2.0, 5.0]], [1, 3]), ([], [0]), ([[2.0, 2.0]], [0])])
def test_on_a_line_the_two_ends_can_be_the_deepest(coordinates, corners):
    """Coordinates by which offsets raise the points, above a face on which all gaps are equal."""
    points = len(coordinates[0]) if coordinates else 3
    offsets = Offsets(np.arange(len(coordinates)), -np.array(coordinates).reshape(-1, points))
    assert gap_map(np.ones((13, points)), offsets).corners.tolist() == corners
