"""Insides of `geometry` under the claims of `tests/test_turned_assemblies.py`."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from tests.test_turned_assemblies import SHIFT, TURNS, moments, polygon_moments
from tolcontact.geometry.overlap import opposite
from tolcontact.geometry.spreading import spread
from tolcontact.geometry.surface import Surface


def lattice(n, width, height, turn):
    """A rectangle with a corner at the origin, in 2 n^2 triangles, turned about z."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, width, n + 1), np.linspace(0, height, n + 1), indexing="ij"))
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.r_[np.c_[corner, corner + n + 1, corner + n + 2], np.c_[corner, corner + n + 2, corner + 1]]
    vertices = Rotation.from_euler("z", turn).apply(np.column_stack([x, y, 0 * x]))
    return trimesh.Trimesh(vertices, faces, process=False)


@pytest.mark.parametrize("n", [1, 3, 40])
@pytest.mark.parametrize("m", [1, 7, 40])
def test_the_region_of_two_planes_does_not_depend_on_their_triangles(n, m):
    """Between the x axis, the line x = 50 and the turned axis there is a triangle: the rectangles reach beyond it."""
    upper, lower = lattice(n, 50, 25, 0.0), lattice(m, 80, 60, -np.pi / 2 + 0.4)
    upper.invert()
    region, _ = opposite(Surface(upper), Surface(lower), 1.0)
    corners = np.array([(0, 0), (50, 0), (50, 50 * np.tan(0.4))])
    area, centre, second = polygon_moments(corners)
    middles, areas = region.mean(axis=1), trimesh.triangles.area(region)
    places = (region + np.roll(region, 1, axis=1)).reshape(-1, 3)[:, :2] / 2
    assert areas.sum() == pytest.approx(area, rel=1e-9) and np.abs(areas @ middles[:, :2] / area - centre).max() < 1e-8
    np.testing.assert_allclose(moments(places, np.repeat(areas, 3))[1], second, rtol=1e-9)


def test_dense_meshes_are_thinned_in_their_own_frame():
    mesh = lattice(100, 50, 25, 0.0)
    points = spread(mesh, 60, None)
    for turn in TURNS:
        turned = trimesh.Trimesh(turn.apply(mesh.vertices) + SHIFT, mesh.faces, process=False)
        np.testing.assert_allclose(turn.inv().apply(spread(turned, 60, None) - SHIFT), points, atol=1e-11)
