"""Insides of `report` under the claims of `tests/test_shared_causes.py`."""

import pytest

import tolcontact as tc
from tests.test_shared_causes import shelf
from tolcontact import vocabulary as terms
from tolcontact.report.analysis_tables import analysis_report


def test_a_cause_that_is_all_that_varies_has_the_derivative_of_what_it_drives():
    found = tc.analyses.sensitivities(shelf({"v": 1.0}), samples=2000, solver="daqp")
    assert found["contributor"].values.tolist() == ["v"] and float(found["step"][0]) == pytest.approx(0.001, rel=0.02)
    own = found.sel(measure="height", contributor="v")
    assert float(own["nominal"]) == pytest.approx(1, abs=1e-9)
    assert own["sensitivity"].sel(state="raw").values == pytest.approx([1, 1, 1], abs=1e-9)
    estimate, lower, upper = own["sensitivity"].sel(state="corrected").values
    assert lower < 0.5 < upper and upper - lower < 0.05 and estimate == pytest.approx(0.5, abs=0.03)
    (table,) = analysis_report(terms.SENSITIVITIES, found).tables
    assert [row[0] for row in table.rows] == ["v"] and table.remarks == []
