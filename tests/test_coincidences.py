"""Scenes of the study of coincidences that once were certified with bodies in each other, had no answer, or failed."""

import pytest

from studies.certificates.coincidences import judged, quick_builds
from studies.certificates.placements import scene

SAMPLES = 10


@pytest.mark.filterwarnings("ignore::tolcontact.NominalWarning")
@pytest.mark.parametrize(
    ("family", "seed"),
    [
        ("lattice of three", 100843),  # five facets of a body lie on a cone
        ("terraces", 93095),  # walls touch along an edge that has a vertex in its middle
        ("terraces", 40035),  # walls that face opposite ways share a corner
        ("terraces", 95111),  # five planes of a corner, of which two pairs oppose each other
        ("lattice unions", 100648),  # a triangle whose area is rounding
        ("lattice unions", 100984),  # the same, nearest to a contact point
        ("pegs", 100504),  # 100 m away, where the hull of a piece is rounded
    ],
)
def test_every_realization_has_a_certificate_that_holds(family, seed):
    with quick_builds():
        findings = judged(scene(seed, family, "all points"), SAMPLES, seed, "daqp")
    assert findings.counts["certified"] == SAMPLES
    assert findings.counts["inside"] == findings.counts["falsely touched"] == findings.counts["lifted off"] == 0
