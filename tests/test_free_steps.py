"""Bodies whose full steps contradict each other find a pose from free ones, and bodies that are apart stay where they are."""

import numpy as np
import pytest

import tolcontact as tc
from studies.certificates.coincidences import judged, quick_builds
from studies.certificates.placements import scene
from tolcontact.simulation import simulate_blocks
from tolcontact.vocabulary import Status

SAMPLES = 12


@pytest.mark.parametrize(("family", "seed"), [("keys", 66), ("combs", 39)])
def test_bodies_that_are_free_nearby_have_an_answer(family, seed):
    with quick_builds():
        findings = judged(scene(seed, family, "all points"), SAMPLES, seed, "daqp")
    assert findings.counts["certified"] == SAMPLES
    assert not findings.wrong


def test_steps_slide_along_what_no_place_of_contact_shows():
    # In realizations 12 and 14 a corner of the lower body is tilted too far against its facet to be a place in all poses.
    with quick_builds():
        findings = judged(scene(40035, "tips", "all points"), 16, 40035, "daqp")
    assert findings.counts["certified"] == 16
    assert not findings.wrong


def test_turns_are_certified_only_where_the_objective_holds_them():
    # All bodies of both scenes turn by 0.3 rad and more; in the first one they touch at a single contact point.
    flat, held = scene(3024, "lattice", "all points"), scene(60018, "lattice", "all points")
    with quick_builds():
        blocks = list(simulate_blocks(tc.build(flat.assembly, solver="daqp"), samples=SAMPLES, seed=3024, threads=1))
        findings = judged(held, SAMPLES, 60018, "daqp")
    assert (np.concatenate([block.status for block in blocks]) == Status.DOUBTFUL).any()
    assert findings.counts["certified"] == SAMPLES
    assert not findings.wrong


def test_a_scene_whose_points_leave_a_rotation_free_is_posed_with_springs():
    with quick_builds():
        findings = judged(scene(3024, "lattice", "all points"), SAMPLES, 3024, "daqp")
    assert findings.counts["stiff"] == findings.counts["certified"] == SAMPLES


def test_bodies_that_are_apart_are_untouched():
    with quick_builds():
        findings = judged(scene(115, "boxes", "all points"), 40, 115, "daqp")
    assert findings.counts["falsely touched"] == findings.counts["lifted off"] == 0
    assert np.isclose(findings.deepest, 0)
