"""Insides of `analyses` under the claims of `tests/test_tails.py`."""

import numpy as np
import pytest

from tests import cases
from tests.helpers import SEATED, compiled
from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import Analysis
from tolcontact.analyses.tails import Side
from tolcontact.variation.plans import uniform


@pytest.mark.slow
def test_normal_scores_are_drawn_as_in_a_run():
    """Two square pins in two slots, rotations alone; larger deviations do not make assembly possible again."""
    program = compiled(cases.square_pins("rotations"), solver="daqp", method=SEATED)
    score = Side(Analysis(terms.TAILS, program))
    u = np.random.default_rng(3).standard_normal((24, len(program.draws.varying)))
    stuck = np.stack([score(factor * u) for factor in 1.3 ** np.arange(7)])
    assert (stuck[1:] >= stuck[:-1]).all() and set(np.unique(stuck)) == {-1.0, 1.0}
    of_run = program.draws(seed=1, start=0, stop=24)
    again = program.draws.from_numbers(lambda label: uniform(1, label, 0, 24), 24)
    assert np.array_equal(again, of_run)
