"""Whole bodies touch where they came in: not at faces that they are nominally beyond."""

import warnings

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.certificates.ends import Convex, judged, scene, separation
from tests.cases.laps import CASES, TABLE, box, case, on_table
from tests.helpers import nightly
from tests.test_ends import FAULTS
from tolcontact.geometry.meeting import Reach, meeting
from tolcontact.geometry.surface import Surface
from tolcontact.vocabulary import Status


@pytest.mark.parametrize("reverses", [False, *nightly(True)])
@pytest.mark.parametrize("name", CASES)
def test_whole_bodies_are_resolved(name, reverses):
    counts, _ = judged(*case(name, reverses=reverses), 40, 1, "daqp")
    assert {fault: counts[fault] for fault in FAULTS} == dict.fromkeys(FAULTS, 0)
    assert counts["certified"] == 40


@pytest.mark.parametrize("seed", [10, *nightly(13, 15, 22, 37)])
def test_whole_surfaces_of_random_bodies(seed):
    counts, _ = judged(*scene(seed, whole=True), 8, seed, "daqp")
    assert {fault: counts[fault] for fault in FAULTS} == dict.fromkeys(FAULTS, 0)
    assert counts["certified"] == 8


@pytest.mark.parametrize("name", ["lap", "long lap", "lap of a wider box"])
def test_whole_bodies_touch_as_the_planes_between_them(name):
    """The same depth before contact, and the same status, as of underside and top, declared by name."""
    whole, *partly = (
        tc.run(case(name, faces)[0], samples=60, seed=2, surfaces=0, fields="none")
        for faces in ((None, None), ("-z", "+z"), ("-z", None), (None, "+z"))
    )
    assert 10 < (whole.status == Status.RESOLVED).sum() < 60
    for run in partly:
        assert np.array_equal(run.status, whole.status)
        depths = [np.minimum(of.gap_min.sel(state="raw"), 0) for of in (run, whole)]
        assert depths[0].values == pytest.approx(depths[1].values, abs=1e-9)


@pytest.mark.parametrize("name", ["lap", "step"])
def test_the_frame_of_whole_bodies_does_not_matter(name):
    runs = [
        tc.run(case(name, turn=turn)[0], samples=40, surfaces=0, fields="none") for turn in ((0.0, 0.0, 0.0), (0.3, -0.5, 1.1))
    ]
    assert np.array_equal(runs[0].status, runs[1].status)
    raw = [run.gap_min.sel(state="raw").values for run in runs]
    assert raw[0] == pytest.approx(raw[1], abs=1e-7)


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


def test_nothing_is_computed_of_the_mean_normal_of_a_closed_body():
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        tc.run(case("lap")[0], samples=10, seed=1)
