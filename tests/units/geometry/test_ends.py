"""Insides of `geometry` under the claims of `tests/test_ends.py`."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from studies.certificates.ends import Convex, piece, separation
from tests.helpers import nightly
from tolcontact.geometry.meeting import Reach, meeting
from tolcontact.geometry.surface import Surface


@pytest.mark.parametrize("seed", [*range(10), *nightly(*range(10, 20))])
def test_bodies_touch_exactly_if_a_place_has_a_gap_below_0(seed):
    """At any pose in which convex bodies hardly touch: the least gap of all places has the sign of their distance."""
    rng = np.random.default_rng(seed)
    reference, moving = piece(rng, True), piece(rng, False)
    bodies = [trimesh.convex.convex_hull(points) for points in (moving, reference)]
    reach = Reach(travel=1.0, tilt=0.1, spread=0.5, overlap=0.0, clearance=0.5)
    places = meeting(tuple(Surface(body) for body in bodies), tuple(bodies), reach)
    convex = Convex(moving), Convex(reference)
    poses, distances = [], []
    for _ in range(200):
        R = Rotation.from_rotvec(rng.normal(size=3) * 0.02).as_matrix()
        t = np.array([*rng.uniform(-0.3, 0.3, 2), 0.0])
        t[2] = rng.uniform(-0.3, 0.3)
        poses.append(np.concatenate([R.ravel(), t]))
        distances.append(separation(*convex, R, t))
    gaps = places.at(np.array(poses)).gaps.min(axis=1, initial=np.inf)
    distances = np.array(distances)
    clear = np.abs(distances) > 1e-9
    assert np.array_equal(gaps[clear] < 0, distances[clear] < 0)


@pytest.mark.parametrize("seed", [*range(4), *nightly(*range(4, 12))])
def test_flat_faces_with_many_corners_touch_exactly_if_a_place_has_a_gap_below_0(seed):
    """Corners and edges of facing planes are sorted, so that most are not looked at."""
    rng = np.random.default_rng(seed)
    outlines = [rng.normal(size=(40, 2)) * 8 + rng.uniform(-6, 6, 2) for _ in range(2)]
    moving, reference = (
        np.array([(x, y, z) for x, y in outline for z in sorted((0.0, end))])
        for outline, end in zip(outlines, (5.0, -5.0), strict=True)
    )
    bodies = [trimesh.convex.convex_hull(points) for points in (moving, reference)]
    reach = Reach(travel=1.0, tilt=0.1, spread=0.5, overlap=0.0, clearance=0.5)
    places = meeting(tuple(Surface(body) for body in bodies), tuple(bodies), reach)
    convex = Convex(moving), Convex(reference)
    turns = Rotation.from_rotvec(rng.normal(size=(150, 3)) * [0.01, 0.01, 0.02]).as_matrix()
    shifts = np.column_stack([rng.uniform(-0.3, 0.3, (150, 2)), rng.uniform(-0.1, 0.3, 150)])
    distances = np.array([separation(*convex, R, t) for R, t in zip(turns, shifts, strict=True)])
    gaps = places.at(np.concatenate([turns.reshape(-1, 9), shifts], axis=1)).gaps.min(axis=1, initial=np.inf)
    clear = np.abs(distances) > 1e-9
    assert 20 < (distances < 0).sum() < 130
    assert np.array_equal(gaps[clear] < 0, distances[clear] < 0)
    near = clear & (distances < 0) & (distances > -0.05)
    assert gaps[near] == pytest.approx(distances[near], rel=0.05)


@pytest.mark.parametrize("moves_bar", [True, False])
@pytest.mark.parametrize("tilt", [0.02, -0.02])
def test_a_bar_longer_than_a_corner_is_deepest_at_the_ends_of_the_corner(tilt, moves_bar):
    """No corner of the bar lies in the channel, and its edge crosses the rims of floor and wall beyond their common corner."""
    floor, wall = (trimesh.creation.box(bounds=[(-10, 0, -10), end]) for end in ((50, 30, 0), (0, 30, 20)))
    channel = trimesh.boolean.union([floor, wall], engine="manifold")
    bar, (x, z) = trimesh.creation.box(bounds=[(0, -5, 0), (30, 35, 8)]), (-0.3, -0.2)
    bodies = (bar, channel) if moves_bar else (channel, bar)
    R, t = Rotation.from_euler("y", -tilt).as_matrix(), np.array([x, 0, z])  # the bar's other end is lifted if it is positive
    motion = np.r_[R.ravel(), t] if moves_bar else np.r_[R.T.ravel(), -R.T @ t]
    reach = Reach(travel=1.0, tilt=0.1, spread=0.5, overlap=0.0, clearance=0.5)
    places = meeting(tuple(Surface(body) for body in bodies), bodies, reach).at(motion[None])
    depth, axis = (z - np.tan(tilt) * x, 2) if tilt > 0 else (x + np.tan(tilt) * z, 0)  # of floor or wall at their end
    across = np.abs(places.n_r[0, :, axis]) > 0.99  # the gap of facing planes is measured along the reference normal
    assert places.gaps[0, across].min() == pytest.approx(depth * (1 if moves_bar else np.cos(tilt)), abs=1e-9)
