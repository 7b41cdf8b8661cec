"""What the search for places leaves out changes none: distant runs, and gaps above a ceiling."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.certificates.placements import FAMILIES, scene
from tests.helpers import nightly
from tests.units.geometry.test_outlines import between, plate
from tolcontact.geometry.meeting import MAX_POINTS
from tolcontact.geometry.places import Look, Places

pytestmark = pytest.mark.filterwarnings("ignore::tolcontact.errors.NominalWarning")


def without_shortcuts(meeting):
    """A meeting whose candidates are all looked at, but for holes that are not reached (see test_outlines.py)."""
    candidates = meeting.candidates
    boxes = np.concatenate([np.full((len(meeting), 2), -np.inf), np.full((len(meeting), 2), np.inf)], axis=1)
    everywhere = candidates._replace(boxes=boxes, widths=np.full(len(candidates.widths), np.inf))
    return replace(meeting, candidates=everywhere)


def poses(rng, count, shift, tilt):
    R = Rotation.from_rotvec(rng.normal(0, tilt, (count, 3))).as_matrix().reshape(-1, 9)
    return np.concatenate([R, rng.normal(0, shift, (count, 3))], axis=1)


def assert_same_places(meeting, X):
    """All places are equal; with a ceiling, those below it, or else the least gap."""
    every = without_shortcuts(meeting).at(X)
    assert all(itertools.starmap(np.array_equal, zip(meeting.at(X), every, strict=True)))
    for ceiling in (0.01, 0.2):
        below = meeting.at(X, Look(ceilings=np.full(len(X), ceiling)))
        for k in range(len(X)):
            expected = set(every.labels[k][every.gaps[k] <= ceiling])
            assert len(expected) == MAX_POINTS or expected <= set(below.labels[k])
            assert below.gaps[k].min(initial=np.inf) == every.gaps[k].min(initial=np.inf)
    return np.isfinite(every.gaps).any(axis=1).sum()


@pytest.mark.parametrize("family", [2, 8, *nightly(*(family for family in range(len(FAMILIES)) if family not in (2, 8)))])
def test_of_whole_bodies_with_coinciding_corners(family):
    rng, found = np.random.default_rng(family), 0
    for seed in range(7100 + family, 7100 + 8 * len(FAMILIES), len(FAMILIES)):
        try:
            placed = scene(seed, list(FAMILIES)[family], "all points")
            program = tc.build(placed.assembly, solver="daqp", method=tc.Method())
        except tc.ModelError:
            continue
        size = min(placed.ranges)
        for meeting in program.meetings.values():
            X = poses(rng, 30, size / 4, 0.005)
            X = X[meeting.covers(X)]
            if len(X):
                found += assert_same_places(meeting, X) > len(X) // 2
        if found:
            break
    assert found


def hinged_poses(rng, count, tilt):
    """Poses tilted about axes beside plates: corners there are high over the other plane, and their projections far from it."""
    R = Rotation.from_rotvec(rng.normal(0, tilt, (count, 3)) * [1, 1, 0.1]).as_matrix()
    hinge = rng.uniform(-60, 60, (count, 3)) * [1, 1, 0]
    return np.concatenate([R.reshape(-1, 9), hinge - np.einsum("nij,nj->ni", R, hinge)], axis=1)


@pytest.mark.parametrize("seed", [0, 1, *nightly(*range(2, 6))])
def test_of_plates_with_holes(seed):
    rng = np.random.default_rng(seed)
    meeting = between(plate(rng, up=True)[0], plate(rng, up=False)[0])
    X = poses(rng, 150, 1.0, 0.005)
    X[::2, 9:11] *= 10
    assert assert_same_places(meeting, X) > 100
    assert assert_same_places(meeting, hinged_poses(rng, 600, 0.1)) > 500


def test_an_empty_slot_holds_the_same_place_whatever_other_poses_have():
    """Arrays of several poses are as wide as the pose with the most places needs."""
    rng = np.random.default_rng(0)
    alone = Places(np.array([[7, 9]]), np.zeros((1, 2)), *rng.normal(size=(3, 1, 2, 3)), np.zeros((1, 2)))
    wider = alone.followed_by(Places.none(1, 3))
    for found, expected in zip(wider.rows(np.array([[9, -1]])), alone.rows(np.array([[9, -1]])), strict=True):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(alone.rows(np.array([[9, 7]]))[0][0], alone.P_m[0, ::-1])
