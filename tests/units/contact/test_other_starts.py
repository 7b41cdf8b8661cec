"""Insides of `contact` under the claims of `tests/test_other_starts.py`."""

from unittest import mock

import pytest

from studies.certificates.coincidences import quick_builds
from studies.certificates.placements import scene
from tests.helpers import simulate
from tolcontact.contact.candidates import Candidates
from tolcontact.vocabulary import Status


@pytest.mark.slow
@pytest.mark.parametrize("seed", [320030, 320045])
def test_interfering_answers_are_rescued_though_a_pair_of_the_group_has_no_guard(seed):
    """As where other bodies of the group grow where they touch. One realization is doubtful without the rescue."""
    with (
        quick_builds(),
        mock.patch.object(Candidates, "are_guarded", False),
        mock.patch.object(Candidates, "partings", {}),
    ):
        _, run = simulate(scene(seed, "lattice of three", "all points").assembly, samples=40, seed=seed, solver="daqp")
    assert (run["status"] <= Status.RESOLVED).all()
