"""Bodies whose full steps contradict each other find a pose from free ones, and bodies that are apart stay where they are."""

import numpy as np
import pytest

from studies.certificates.coincidences import judged, quick_builds
from studies.certificates.placements import scene
from tests.helpers import nightly

SAMPLES = 12
# Shape checks take several times as long as the rest, so that only two realizations of some scenes have them.
CHECKED_SAMPLES = 2
LONG = [("keys", 66, SAMPLES), ("combs", 39, SAMPLES), ("keys", 110344, 20)]


@pytest.mark.parametrize(
    ("family", "seed", "samples"),
    [
        ("combs", 39, CHECKED_SAMPLES),
        ("keys", 110344, CHECKED_SAMPLES),
        *nightly(*LONG),
    ],
)
def test_bodies_that_are_free_nearby_have_an_answer(family, seed, samples):
    with quick_builds():
        findings = judged(scene(seed, family, "all points"), samples, seed, "daqp")
    assert findings.counts["certified"] == samples
    assert not findings.wrong


@pytest.mark.slow
def test_short_steps_find_an_answer_where_free_bodies_go_to_and_fro():
    with quick_builds():
        findings = judged(scene(800196, "pegs", "all points"), 8, 800196, "graph")
    assert findings.counts["certified"] == 8
    assert not findings.wrong


def test_a_scene_whose_points_leave_a_rotation_free_is_posed_with_springs():
    with quick_builds():
        findings = judged(scene(3024, "lattice", "all points"), SAMPLES, 3024, "daqp")
    assert findings.counts["stiff"] == SAMPLES and not findings.wrong


@pytest.mark.slow
def test_bodies_that_are_apart_are_untouched():
    with quick_builds():
        findings = judged(scene(115, "boxes", "all points"), 40, 115, "daqp")
    assert findings.counts["falsely touched"] == findings.counts["lifted off"] == 0
    assert np.isclose(findings.deepest, 0)
