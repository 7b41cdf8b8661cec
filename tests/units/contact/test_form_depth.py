"""Insides of `contact` under the claims of `tests/test_form_depth.py`."""

import numpy as np

from tests.helpers import simulate
from tests.test_form_depth import box_on_box
from tolcontact.contact.candidates import Candidates
from tolcontact.vocabulary import CORRECTED


def test_answers_that_lie_deeper_are_noticed():
    program, run = simulate(box_on_box("block"), samples=40, solver="daqp")
    candidates, deviations = Candidates(program, program.groups[0]), run["deviations"]
    relative = program.observe(poses=run["poses"][:, CORRECTED], deviations=deviations)["relative"].reshape(40, 1, 12)
    scans = candidates.scans(relative, deviations)
    lowered = relative - np.eye(12)[11] * 0.0005
    for X_RM, expected in ((relative, False), (lowered, True)):
        assert (candidates.bulge(candidates.scans(X_RM, deviations, earlier=scans), X_RM) == expected).all()
