"""Insides of `report` under the claims of `tests/test_clashes.py`."""

import re
import warnings

import pytest

import tolcontact as tc
from tests.test_clashes import beside_wall
from tolcontact.report.results_table import result_rows, verdict_lines


@pytest.fixture(scope="module")
def results():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tc.NominalWarning)
        return tc.run(beside_wall(), samples=2000, seed=1, surfaces=0)


def test_verdicts_have_the_clashes_beside_them(results):
    summary = tc.summarize(results)
    (row,) = result_rows(summary)
    reservation = r"; but parts lie in each other in 3\d\.\d % \[[\d., ]+\] of realizations"
    assert re.fullmatch(f"(does not meet|meets|undecided.*){reservation}", row.verdict), row.verdict
    assert row.is_good is None
    assert re.search(reservation, next(verdict_lines(summary)))
