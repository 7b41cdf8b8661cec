"""Insides of `workflow` under the claims of `tests/test_limits_of_models.py`."""

import pytest

import tolcontact as tc
from tests.helpers import ROOT
from tests.test_limits_of_models import RA1
from tolcontact.workflow.forecast import announce


def test_a_run_that_would_take_longer_than_anybody_waits_is_refused():
    program = tc.build(ROOT / RA1, solver="daqp")
    with pytest.raises(tc.OptionError, match=r"1000000000000 realizations would take about \d+ days; ask for at most \d+"):
        announce(program, samples=10**12, seed=1, keep="measures", threads=1)
