"""The part of a face that is opposite to another one: exact, and the same for other triangles, frames, and mirrored."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from tests.cases.blocks import combs
from tolcontact.geometry.overlap import opposite
from tolcontact.geometry.surface import Surface

TURN, SHIFT = Rotation.from_rotvec((0.4, -1.1, 0.7)).as_matrix(), np.array((31.0, -17.0, 90.0))
MIRROR = np.diag([-1.0, 1.0, 1.0])


def moments(face, target, within, R=None, t=(0, 0, 0)):
    """Area, centre and second moments of what is opposite, with both bodies mapped by R and t, and mapped back."""
    A = np.eye(3) if R is None else R
    bodies = [trimesh.Trimesh(mesh.vertices @ A.T + t, mesh.faces, process=False) for mesh in (face, target)]
    for mesh in bodies:
        if np.linalg.det(A) < 0:
            mesh.invert()
    part, cosines = opposite(*map(Surface, bodies), within)
    places = ((part + np.roll(part, 1, axis=1)).reshape(-1, 3) / 2 - t) @ np.linalg.inv(A).T
    shares = np.repeat(trimesh.triangles.area(part) * cosines / 3, 3)
    centre = shares @ places / shares.sum()
    return shares.sum(), centre, (places - centre).T @ ((places - centre) * shares[:, None]) / shares.sum()


def test_the_walls_of_a_box_on_a_table_are_not_opposite_to_it():
    box, table = (trimesh.creation.box(bounds=bounds) for bounds in ([[30, 15, 0], [70, 45, 10]], [[0, 0, -10], [60, 60, 0]]))
    area, centre, second = moments(box, table, 5)
    assert area == pytest.approx(30 * 30) and np.allclose(centre, (45, 30, 0))
    assert np.allclose(second, np.diag([75, 75, 0]), atol=1e-9)
    np.testing.assert_allclose(moments(table, box, 5)[0], area)


def test_only_the_nearest_faces_count_and_none_behind_a_tooth():
    """Areas by hand: tips of five and of five teeth, and both walls of five teeth; walls of other grooves are 10.1 mm away."""
    upper, lower = combs()
    area = 20 * 5 * (4.0 + 5.8 + 2 * 7.9)
    for within in (0.15, 5.0, 7.5):
        assert moments(upper, lower, within)[0] == pytest.approx(area, rel=1e-6)
        assert moments(lower, upper, within)[0] == pytest.approx(area, rel=1e-6)
    grounds = 20 * 5 * 0.2  # of the grooves beside the teeth, 8.1 mm away
    for within in (9.0, 12.0):
        assert moments(upper, lower, within)[0] == pytest.approx(area + grounds, rel=1e-6)
        assert moments(lower, upper, within)[0] == pytest.approx(area + grounds, rel=1e-6)


@pytest.mark.parametrize("within", [0.15, 6.0, 25.0])
def test_neither_triangles_nor_frames_nor_mirrors_change_the_moments(within):
    upper, lower = combs()
    expected = moments(upper, lower, within)
    finer = upper.subdivide(), lower.subdivide().subdivide()
    for bodies, R in ((finer, None), ((upper, lower), TURN), (finer, MIRROR @ TURN)):
        for value, same in zip(moments(*bodies, within, R, (0, 0, 0) if R is None else SHIFT), expected, strict=True):
            np.testing.assert_allclose(value, same, rtol=1e-9, atol=1e-8)


def test_exchanging_parallel_faces_changes_nothing():
    upper, lower = combs()
    assert moments(upper, lower, 0.15)[0] == pytest.approx(moments(lower, upper, 0.15)[0], rel=1e-9)
