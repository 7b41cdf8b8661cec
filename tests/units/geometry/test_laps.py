"""Insides of `geometry` under the claims of `tests/test_laps.py`."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from studies.certificates.ends import Convex, separation
from tests.cases.laps import TABLE, box, on_table
from tolcontact.geometry.meeting import Reach, meeting
from tolcontact.geometry.surface import Surface


@pytest.mark.parametrize("lap, overlap", [(1.5, 0.0), (0.8, 0.0), (1.5, 0.1)])
@pytest.mark.parametrize("low, high", [(10, 40), (-10, 60), (48, 90)])
def test_the_least_gap_of_a_lap_is_the_depth_of_the_bodies(lap, overlap, low, high):
    """It is the signed distance by separating axes, but for the square of the tilt."""
    block, _ = on_table(lap, low, high, overlap)
    points = box(*block), box(*TABLE)
    bodies = [trimesh.convex.convex_hull(corners) for corners in points]
    reach = Reach(travel=2.0, tilt=0.01, spread=0.5, overlap=overlap, clearance=0.0)
    places = meeting(tuple(Surface(body) for body in bodies), tuple(bodies), reach)
    rng, convex = np.random.default_rng(3), [Convex(corners) for corners in points]
    middle = np.array([40, (low + high) / 2, 13])
    R = Rotation.from_rotvec(rng.uniform(-0.003, 0.003, (200, 3))).as_matrix()
    t = middle - R @ middle + rng.uniform(-0.3, 0.3, (200, 3))
    gaps = places.at(np.hstack([R.reshape(-1, 9), t])).gaps.min(axis=1, initial=np.inf)
    distances = np.array([separation(*convex, *pose) for pose in zip(R, t, strict=True)])
    assert 60 < (distances < 0).sum()
    assert np.array_equal(gaps < 0, distances < 0)
    assert np.minimum(gaps, 0) == pytest.approx(np.minimum(distances, 0), abs=1e-3)
