"""The default's answers are optima: a nonlinear solver that shares no code finds no better pose near them."""

import numpy as np
import pytest

import tolcontact as tc
from studies.certificates import optima
from studies.certificates.coincidences import quick_builds
from studies.certificates.least_poses import ALL, SEATING, Search, counted
from studies.certificates.optima import case_scene, compared, ends_scene, judged, placed_scene, scene_of
from tests.cases.ends import case
from tests.helpers import nightly


@pytest.fixture(autouse=True)
def builds_are_quick():
    with quick_builds():
        yield


@pytest.mark.parametrize("seeds", [range(6002, 6004), *nightly(*(range(first, first + 20) for first in range(6100, 6180, 20)))])
def test_no_better_pose_is_near_a_resolved_one(seeds):
    """In some scenes no realization is both touched and resolved."""
    assert_best([row for seed in seeds for row in judged(ends_scene(seed), samples=4, seed=seed, starts=1)])


# The others are seldom touched.
TOUCHED = ("needles, tilted", "chamfered pads", "cone", "steep cone", "cone above", "rib", "roof", "crossing roofs")


@pytest.mark.parametrize("name", ["steep cone", *nightly(*(name for name in TOUCHED if name != "steep cone"))])
def test_nor_where_faces_end_within_reach(name):
    assert_best(judged(case_scene(*case(name)), samples=5, seed=1, starts=1))


# The rim of a face crosses another one; a corner lies on a convex edge of a whole body.
CORNERS_ON_EDGES = [(92006, 2), *nightly((92003, 2), (92199, 3), (92230, 3))]


@pytest.mark.parametrize(("seed", "samples"), CORNERS_ON_EDGES)
def test_nor_where_corners_lie_on_edges(seed, samples):
    rows = judged(placed_scene(seed, ALL), samples=samples, seed=seed, starts=0)
    assert {row["kind"] for row in rows} == {"none better"}


@pytest.mark.parametrize("objective", [ALL, SEATING])
@pytest.mark.parametrize("seed", [1, *nightly(7, 14)])
def test_nor_where_faces_deviate_or_forces_press(seed, objective):
    rows = judged(scene_of("blocks", seed, objective), samples=3, seed=seed, objective=objective, starts=0)
    assert {row["kind"] for row in rows} == {"none better"}


def test_a_pose_that_is_lifted_too_far_is_found_out():
    scene = case_scene(*case("roof"))
    program = tc.build(scene.assembly, solver="daqp", method=tc.Method())
    run = tc.run(program, samples=8, seed=1, fields="none", surfaces=0)
    k = int((run.status == tc.Status.RESOLVED).argmax())
    poses = np.concatenate([run.rotation.values[k].reshape(2, 2, 9), run.translation.values[k]], axis=-1)
    search, sides = Search(scene, program, ALL), counted(program, ALL, poses[0])
    raw, lifted = search.centred(poses[0]), search.centred(poses[1])
    lifted[1, 11] += 0.03  # mm
    near = search.least(raw, lifted, sides)
    row = compared(search.energy(raw, lifted, sides), lifted, near, near, search)
    assert optima.kind_of(row) == "better near"


def assert_best(rows):
    """No search that begins at an answer finds a better pose beside it; and most that begin elsewhere find this answer."""
    assert {row["kind"] for row in rows} <= {"none better", "better far", "untouched"}
    searched = [row for row in rows if row["kind"] != "untouched"]
    assert searched and sum(row["found again"] for row in searched) >= len(searched) / 2
